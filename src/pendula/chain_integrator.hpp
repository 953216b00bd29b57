#pragma once

#include <memory>
#include <pendula/forward_dynamics.hpp>
#include <pendula/integrator.hpp>
#include <pendula/options.hpp>

namespace pendula {

/// Gauss–Legendre in momentum form over the O(n) chain solver, for any number of links; poles are no obstacle. Throws
/// std::invalid_argument for stages without a tableau, and for the velocity form, which has no chain solver.
template <class Space>
std::unique_ptr<Integrator<Space>> make_chain_integrator(const Chain<Space>& chain, const RunOptions& options);

/// Accelerations of a chain of any number of links in O(n), in (θ, φ): not at a pole.
template <class Space>
std::unique_ptr<ForwardDynamics<Space>> make_chain_forward_dynamics(const Chain<Space>& chain);

extern template std::unique_ptr<Integrator<Planar>> make_chain_integrator(const Chain<Planar>&, const RunOptions&);
extern template std::unique_ptr<Integrator<Spatial>> make_chain_integrator(const Chain<Spatial>&, const RunOptions&);
extern template std::unique_ptr<ForwardDynamics<Planar>> make_chain_forward_dynamics(const Chain<Planar>&);
extern template std::unique_ptr<ForwardDynamics<Spatial>> make_chain_forward_dynamics(const Chain<Spatial>&);

namespace detail {

/// The integrator of a fixed number of stages; each is compiled in a translation unit with a few others.
template <class Space, int S>
std::unique_ptr<Integrator<Space>> make_chain_stages(const Chain<Space>& chain, const RunOptions& options);

}  // namespace detail

}  // namespace pendula
