#pragma once

#include <pendula/system/options.hpp>

namespace pendula {

/// What `solver = "auto"` is. The velocity form is the dense solver's alone. On few links in the plane fixed points
/// over the generated kernel, where there is one, take less, whatever the registers are (table "few links" in
/// docs/benchmarks.md). In space kernels cannot pass a pole.
template <class Space>
Solver solver_for(int links, const RunOptions& options, bool has_kernel) {
  if (options.solver != Solver::automatic) return options.solver;
  if (options.form == Form::velocity) return Solver::dense;
  const bool may_be_faster = Space::dof == 1 && has_kernel && options.iteration != Iteration::newton;
  return may_be_faster && (links == 1 || (links <= 3 && options.stages > links)) ? Solver::dense : Solver::chain;
}

}  // namespace pendula
