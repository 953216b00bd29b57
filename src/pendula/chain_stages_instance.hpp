#pragma once

#include <pendula/chain_integrator.hpp>
#include <pendula/gauss/chain_solver.hpp>
#include <pendula/gauss/gauss_integrator.hpp>

namespace pendula::detail {

template <class Space, int S>
std::unique_ptr<Integrator<Space>> make_chain_stages(const Chain<Space>& chain, const RunOptions& options) {
  return std::make_unique<GaussIntegrator<ChainSolver<Space, S>>>(chain, S, Description{"chain", "", ""},
                                                                  options.iteration);
}

}  // namespace pendula::detail
