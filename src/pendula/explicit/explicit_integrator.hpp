#pragma once

#include <memory>
#include <pendula/explicit/forward_dynamics.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <string_view>

namespace pendula {

/// The explicit Runge–Kutta methods of paper §3.2, and extrapolation, from Boost.odeint, on any source of
/// accelerations. `parts` is what failures name: the links of a chain, or the coordinates. `kernel` names the fixed-n
/// kernel behind `dynamics`. Throws std::invalid_argument for Method::gauss or a tolerance ≤ 0.
std::unique_ptr<PlainIntegrator> make_explicit_integrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates,
                                                          int parts, const RunOptions& options,
                                                          std::string_view kernel);

}  // namespace pendula
