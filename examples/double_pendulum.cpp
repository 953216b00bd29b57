// The commonest tasks on a double pendulum that is let go from the horizontal.
#include <pendula/pendula.hpp>

#include <iostream>
#include <numbers>

int main() {
  using namespace pendula;
  const Chain<Planar> chain({.masses = Eigen::Vector2d(1, 1), .lengths = Eigen::Vector2d(1, 1)});
  const auto start = State<Planar>::from_angles(Eigen::Vector2d::Constant(std::numbers::pi / 2));

  // A motion, by steps of its own choice, and its rows.
  Simulation run(chain, start, {.tolerance = 1e-12});
  run.write_csv("double_pendulum.csv", every(0.01));
  run.advance_to(10);
  std::cout << "last bob at " << run["x_2"] << ", " << run["y_2"] << " m; at 9.5 s theta_2 was " << run.at(9.5).q[1]
            << '\n';

  // Events: how often the second link turns over. A copy goes on as the first does, to the bit.
  int turns = 0;
  Simulation copy = run;
  copy.on({.value = [](const Motion& m) { return std::cos(m.q[1] / 2); }}, [&](const Motion&) { ++turns; });
  copy.advance_to(30);
  std::cout << "it turns over " << turns << " times from 10 to 30 s\n";

  // Many at once: a row of angles, or of angles and rates, is a start.
  const Eigen::MatrixXd starts = Eigen::MatrixXd::Random(1000, 2);
  const Ends ends = propagate(chain, starts, {.duration = 2});
  std::cout << "on average theta_2 is " << ends.q.col(1).mean() << " after 2 s\n";

  // Beside the motion: d(q, v)/dt = A (q, v) + B torques.
  Simulation hanging(chain, State<Planar>::from_angles(Eigen::Vector2d::Zero()));
  const auto [A, B] = hanging.linearize();
  std::cout << "at rest A is\n" << A << '\n';

  // A control loop: an input is held until another value is, here a torque that damps the first link.
  for (int k = 1; k <= 100; ++k) {
    hanging.hold("torque_1", 0.1 - 2 * hanging.motion().v[0]);
    hanging.advance_to(0.01 * k);
  }
  std::cout << "after a second theta_1 is " << hanging["theta_1"] << '\n';

  // How fast neighbouring motions part: the leading Lyapunov exponent.
  const LyapunovSpectrum chaos = lyapunov(chain, start, {.duration = 100, .count = 1});
  std::cout << "by e in " << 1 / chaos.exponents[0] << " s\n";
}
