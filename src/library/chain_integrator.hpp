#pragma once

#include <memory>
#include <pendula/chain/chain.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>

namespace pendula {

/// Gauss–Legendre in momentum form with the O(n) chain solver, for any number of links; passes poles. Throws
/// std::invalid_argument for stages without a tableau, and for the velocity form, which has no chain solver.
template <class Space>
std::unique_ptr<PlainIntegrator> make_chain_integrator(const Chain<Space>& chain, const RunOptions& options);

extern template std::unique_ptr<PlainIntegrator> make_chain_integrator(const Chain<Planar>&, const RunOptions&);
extern template std::unique_ptr<PlainIntegrator> make_chain_integrator(const Chain<Spatial>&, const RunOptions&);

/// The same for a fixed number of stages, in translation units that CMake writes (cmake/chain_stages.cpp.in).
template <class Space, int S>
std::unique_ptr<PlainIntegrator> make_chain_stages(const Chain<Space>& chain, const RunOptions& options);

}  // namespace pendula
