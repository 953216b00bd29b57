#pragma once

#include <pendula/system/options.hpp>

namespace pendula {

/// The solver that `solver = "auto"` selects. Only the dense solver has the velocity form. For few links in the plane
/// it is the faster one with fixed-point iteration, on every instruction set (table "few links" in
/// docs/reference/benchmarks.md).
/// In space a generated kernel cannot pass a pole, so the chain solver is selected.
template <class Space>
Solver solver_for(int links, const RunOptions& options, bool has_kernel) {
  if (options.solver != Solver::automatic) return options.solver;
  if (options.form == Form::velocity) return Solver::dense;
  const bool may_be_faster = Space::dof == 1 && has_kernel && options.iteration != Iteration::newton;
  return may_be_faster && (links == 1 || (links <= 3 && options.stages > links)) ? Solver::dense : Solver::chain;
}

}  // namespace pendula
