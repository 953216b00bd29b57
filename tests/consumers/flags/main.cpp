// Everything that crosses between a program and the compiled library does so once, in both directions, and comes back
// right and can be freed.
#include <pendula/kernels/planar_3.hpp>
#include <pendula/pendula.hpp>
#include <span>
#include <utility>

#include "runs.hpp"

namespace {

// The same again by what is behind pendula.h; callbacks and rows come back from there.
State<Planar> by_simulation(const Chain<Planar>& chain) {
  Simulation run(chain, start<Planar>(), {.stages = 2, .solver = Solver::chain, .step = step});
  std::vector<std::vector<double>> rows;
  int lows = 0;
  run.on({.value = [](const Motion& motion) { return motion.v[0]; }}, [&](const Motion&) { ++lows; });
  run.on_rows(every(duration / 2), [&](std::span<const double> row) { rows.emplace_back(row.begin(), row.end()); });
  Simulation copy = run;
  run.advance_to(duration);
  copy.advance_to(duration);
  if (rows.size() != 3 || lows == 0) throw std::runtime_error("expected 3 rows and an event");
  if (copy.motion().q != run.motion().q) throw std::runtime_error("a copy went elsewhere");
  return run.motion();
}

template <class Error, class Action>
bool throws(const std::string& what, Action action) {
  try {
    action();
  } catch (const Error& error) {
    const bool good = std::string(error.what()).find(what) != std::string::npos;
    std::cout << error.what() << (good ? "" : ": WRONG") << '\n';
    return good;
  }
  std::cout << "nothing was thrown: " << what << '\n';
  return false;
}

}  // namespace

int main() {
  std::cout << "library for " << instruction_set() << ", heap aligned to " << EIGEN_DEFAULT_ALIGN_BYTES << '\n';
  const RunOptions chain{.solver = Solver::chain}, dense{.solver = Solver::dense};
  // Two discretisations of one motion: with so many stages, both are the motion.
  const RunOptions exact_chain{.stages = 6, .solver = Solver::chain}, exact_dense{.stages = 6, .solver = Solver::dense};
  const auto planar = loaded_chain<Planar>();

  bool good = same("in a simulation", by_library<Planar>(chain), by_simulation(planar));
  good = same("in the plane", by_library<Planar>(exact_chain), by_library<Planar>(exact_dense)) && good;
  good = same("in space", by_library<Spatial>(exact_chain), by_library<Spatial>(exact_dense)) && good;

  for (const KernelInfo& kernel : built_in_kernels()) std::cout << kernel.name << ' ';
  std::cout << make_integrator(planar, dense)->describe().kernel << '\n';
  good = throws<NoKernel>("planar_3",
                          [&] {
                            const Chain<Planar> long_chain(
                                {.masses = Eigen::VectorXd::Ones(77), .lengths = Eigen::VectorXd::Ones(77)});
                            make_integrator(long_chain, dense);
                          }) &&
         good;
  good = throws<std::invalid_argument>("expected 1 to 8", [&] { make_integrator(planar, {.stages = 99}); }) && good;
  good = throws<std::invalid_argument>(
             "expected 3 numbers, got 4",
             [&] { Simulation(planar, State<Planar>::from_angles(Eigen::VectorXd::Ones(4))); }) &&
         good;
  good = throws<std::invalid_argument>(
             "expected 3 numbers",
             [&] { make_integrator(planar, chain)->start(State<Planar>::from_angles(Eigen::VectorXd::Ones(4))); }) &&
         good;
  return good ? 0 : 1;
}
