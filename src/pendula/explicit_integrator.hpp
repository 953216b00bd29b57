#pragma once

#include <memory>
#include <pendula/forward_dynamics.hpp>
#include <pendula/integrator.hpp>
#include <string>

namespace pendula {

/// The explicit Runge–Kutta methods of paper §3.2, from Boost.odeint, on any source of accelerations. `kernel` names
/// the fixed-n kernel behind `dynamics`. Throws std::invalid_argument for Method::gauss or a tolerance ≤ 0.
template <class Space>
std::unique_ptr<Integrator<Space>> make_explicit_integrator(std::unique_ptr<ForwardDynamics<Space>> dynamics,
                                                            const RunOptions& options, std::string kernel);

extern template std::unique_ptr<Integrator<Planar>> make_explicit_integrator(std::unique_ptr<ForwardDynamics<Planar>>,
                                                                             const RunOptions&, std::string);
extern template std::unique_ptr<Integrator<Spatial>> make_explicit_integrator(std::unique_ptr<ForwardDynamics<Spatial>>,
                                                                              const RunOptions&, std::string);

}  // namespace pendula
