// How far can a run be trusted? A falling chain of fifty links in double, and once more in long double, whose rounding
// is 2000 times finer: they differ by the rounding error of the first.
#include <pendula/chain/chain_solver.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/gauss/stepper.hpp>

#include <iostream>

using namespace pendula;

template <class Real>
Points<Planar, Eigen::Dynamic, Real> last_positions(const Chain<Planar>& chain, const State<Planar>& start) {
  GaussStepper<ChainSolver<Planar, 8, Eigen::Dynamic, Real>> stepper(chain, 8);
  Outcome outcome = stepper.start(start.cast<Real>());
  for (int step = 0; outcome && step < 256; ++step) outcome = stepper.step(1.0 / 1024);
  if (!outcome) throw std::runtime_error(message(outcome));
  return bob_positions(chain, stepper.state());
}

int main() {
  const int links = 50;
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::VectorXd::Ones(links);
  parameters.lengths = Eigen::VectorXd::Constant(links, 1.0 / 64);
  const Chain<Planar> chain(parameters);
  const auto start = State<Planar>::from_angles(Eigen::VectorXd::Constant(links, 1.5));

  const auto in_double = last_positions<double>(chain, start);
  const auto in_long_double = last_positions<long double>(chain, start);
  std::cout << "after 0.25 s the last bob is at " << in_double.col(links - 1).transpose() << " m\n"
            << "largest rounding error of a bob: "
            << (in_double.cast<long double>() - in_long_double).cwiseAbs().maxCoeff() << " m\n";
}
