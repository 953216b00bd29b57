// Where a chain is at given times, by methods, equations and variables that pendula does not use: rod directions in
// Cartesian coordinates, 80-bit numbers, and
//   extrapolation  Gragg, Bulirsch, Stoer (odeint), bobs and tensions
//   fehlberg       Fehlberg 7(8) (odeint), dense equations with multipliers
//   implicit       extrapolated linearly implicit Euler, bobs and tensions, for heavy damping
//
// usage: chain_reference METHOD TOLERANCE LIMIT DISTURBANCE [states|dense] < numbers > numbers
//
// LIMIT bounds the evaluations of the equations (exit status 3 beyond), DISTURBANCE moves the start. Numbers in, as
// reference.py writes them: dimension, links, gravity; per link mass, length, damping, torque (3); number of drives,
// for each link, amplitude (3), frequency, phase; per link u (3) as theta, phi and their rates; number of times, times.
// Numbers out, a line a time: the fastest bob so far, bobs, velocities. With `states` and `dense` rows of long doubles
// instead, at each time or at 20 places of each step: u, du/dt, t, and how far each rod has turned, in the plane.
#include <journey.hpp>

namespace reference {
namespace {

struct Run {
  Problem problem;
  State start;
  std::vector<Real> times;
};

Vector next_vector() {
  Vector vector;
  for (Real& component : vector) component = next();
  return vector;
}

void read_start(bool spatial, std::size_t link, Run& run) {
  const Real theta = next(), phi = next(), theta_dot = next(), phi_dot = next();
  const Real s = std::sin(theta), c = std::cos(theta);
  Vector u = {s, -c, 0}, rate = {c * theta_dot, s * theta_dot, 0};
  if (spatial) {
    const Real sp = std::sin(phi), cp = std::cos(phi);
    u = {s * cp, s * sp, -c};
    rate = {c * cp * theta_dot - s * sp * phi_dot, c * sp * theta_dot + s * cp * phi_dot, s * theta_dot};
  }
  std::copy(u.begin(), u.end(), run.start.begin() + static_cast<std::ptrdiff_t>(3 * link));
  std::copy(rate.begin(), rate.end(), run.start.begin() + static_cast<std::ptrdiff_t>(3 * (run.problem.links + link)));
}

Run read_run() {
  Run run;
  Problem& problem = run.problem;
  const bool spatial = next() == 3;
  problem.up = spatial ? Vector{0, 0, 1} : Vector{0, 1, 0};
  problem.links = count();
  problem.gravity = next();
  for (std::size_t i = 0; i < problem.links; ++i) {
    problem.mass.push_back(next());
    problem.length.push_back(next());
    problem.damping.push_back(next());
    problem.torque.push_back(next_vector());
  }
  for (std::size_t left = count(); left-- > 0;) {
    Drive drive;
    drive.link = count();
    drive.amplitude = next_vector();
    drive.frequency = next();
    drive.phase = next();
    problem.drives.push_back(drive);
  }
  run.start.resize(6 * problem.links + 1);
  for (std::size_t i = 0; i < problem.links; ++i) read_start(spatial, i, run);
  for (std::size_t left = count(); left-- > 0;) run.times.push_back(next());
  return run;
}

/// Moves the start by about `size` of a turn and of the rates, always in the same arbitrary direction.
void disturb(Run& run, Real size) {
  const std::size_t n = run.problem.links;
  Real fastest = 1;
  for (std::size_t i = 0; i < n; ++i)
    fastest = std::max(fastest, std::sqrt(dot(rod(run.start, n + i), rod(run.start, n + i))));
  for (std::size_t k = 0; k < 6 * n; ++k) {
    if (run.problem.up[2] == 0 && k % 3 == 2) continue;  // stay in the plane
    run.start[k] += size * std::cos(Real(1.7) * Real(k) + Real(0.3)) * (k < 3 * n ? 1 : fastest);
  }
  project(run.problem, run.start);
}

/// Bobs, or their velocities: running sums of l_i times what stands in the state from `first` on.
std::vector<Vector> sums(const Problem& problem, const State& y, std::size_t first) {
  std::vector<Vector> points(problem.links);
  Vector sum{};
  for (std::size_t i = 0; i < problem.links; ++i) {
    const Vector step = rod(y, first + i);
    for (std::size_t c = 0; c < 3; ++c) points[i][c] = sum[c] += problem.length[i] * step[c];
  }
  return points;
}

class Chain {
 public:
  explicit Chain(Problem problem, const State& start) : problem_(std::move(problem)), turned_(problem_.links) {
    pass(start, start);
  }

  const Problem& problem() const { return problem_; }

  /// No rod turns by more than two radians in a step, so that turns can be counted.
  Real longest(const State& y) const {
    Real rate = 1e-3L;
    for (std::size_t i = 0; i < problem_.links; ++i) {
      const Vector turning = rod(y, problem_.links + i);
      rate = std::max(rate, std::sqrt(dot(turning, turning)));
    }
    return 2 / rate;
  }

  void project(State& y) const { reference::project(problem_, y); }

  void pass(const State& before, const State& now) {
    for (std::size_t i = 0; i < problem_.links; ++i) turned_[i] += angle(rod(before, i), rod(now, i));
    for (const Vector& velocity : sums(problem_, now, problem_.links)) {
      fastest_ = std::max(fastest_, std::sqrt(dot(velocity, velocity)));
    }
  }

  /// How far rods had turned is known of `from`.
  std::vector<Real> row(const State& now, const State& from) const {
    std::vector<Real> row = now;
    for (std::size_t i = 0; i < problem_.links; ++i) row.push_back(turned_[i] + angle(rod(from, i), rod(now, i)));
    return row;
  }

  void print(const State& y) const {
    std::printf("%.21Lg", fastest_);
    for (const std::size_t first : {std::size_t{0}, problem_.links}) {
      for (const Vector& point : sums(problem_, y, first)) {
        for (const Real component : point) std::printf(" %.21Lg", component);
      }
    }
    std::printf("\n");
  }

 private:
  static Real angle(const Vector& from, const Vector& to) {
    return std::atan2(from[0] * to[1] - from[1] * to[0], from[0] * to[0] + from[1] * to[1]);
  }

  Problem problem_;
  std::vector<Real> turned_;
  Real fastest_ = 0;
};

Telling telling_of(const std::string& word) {
  if (word == "states") return Telling::states;
  if (word == "dense") return Telling::dense;
  std::cerr << "chain_reference: expected states or dense, got '" << word << "'\n";
  std::exit(2);
}

int answer(Run run, const std::string& method, Real tolerance, Real limit, Telling telling) {
  const Problem problem = run.problem;
  Journey<Chain> journey(Chain(run.problem, run.start), run.start, run.times, limit);
  const auto tensions = [&](const State& y, State& dy) { tension_form(problem, y, dy); };
  const auto dense = [&](const State& y, State& dy) { dense_form(problem, y, dy); };
  const auto differentiate = [&](const State& y, Matrix& jacobian) { by_differences(tensions, y, jacobian); };
  if (method == "fehlberg") return reference::travel(journey, method, tolerance, telling, dense, differentiate);
  return reference::travel(journey, method, tolerance, telling, tensions, differentiate);
}

}  // namespace
}  // namespace reference

int main(int count, char** words) {
  if (count != 5 && count != 6) {
    std::cerr << "usage: chain_reference METHOD TOLERANCE LIMIT DISTURBANCE [states|dense] < numbers > numbers\n";
    return 2;
  }
  reference::Run run = reference::read_run();
  reference::disturb(run, std::strtold(words[4], nullptr));
  const auto telling = count == 6 ? reference::telling_of(words[5]) : reference::Telling::lines;
  return reference::answer(std::move(run), words[1], std::strtold(words[2], nullptr), std::strtold(words[3], nullptr),
                           telling);
}
