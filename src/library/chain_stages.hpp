#pragma once

#include <pendula/chain/chain_solver.hpp>
#include <pendula/gauss/gauss_integrator.hpp>

#include "library/chain_integrator.hpp"

namespace pendula {

template <class Space, int S>
std::unique_ptr<PlainIntegrator> make_chain_stages(const Chain<Space>& chain, const RunOptions& options) {
  const GaussDescription described{"chain", "", chain.links()};
  return std::make_unique<GaussIntegrator<ChainSolver<Space, S>>>(chain, options, described, options.iteration,
                                                                  family_of(options.method));
}

}  // namespace pendula
