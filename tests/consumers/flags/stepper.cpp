// A stepper that the program compiles for itself goes where the library's goes, each with its own flags.
#include <pendula/chain/chain_solver.hpp>
#include <pendula/gauss/stepper.hpp>

#include "runs.hpp"

namespace {

State<Planar> by_stepper(const Chain<Planar>& chain) {
  GaussStepper<ChainSolver<Planar, 2>> stepper(chain, 2);
  Outcome outcome = stepper.start(start<Planar>());
  while (outcome && stepper.time() < duration - step / 2) outcome = stepper.step(step);
  if (!outcome) throw std::runtime_error(message(outcome));
  return stepper.state();
}

}  // namespace

int main() {
  const auto library = by_library<Planar>({.solver = Solver::chain});
  return same("here and there", library, by_stepper(loaded_chain<Planar>())) ? 0 : 1;
}
