#pragma once

#include <memory>
#include <pendula/explicit/forward_dynamics.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <string_view>

namespace pendula {

/// Bulirsch–Stoer extrapolation for any source of accelerations, with adaptive steps. `parts` is the number of parts
/// that failures name: the links of a chain, or the coordinates. `kernel` names the fixed-n kernel behind `dynamics`.
/// Throws std::invalid_argument for a tolerance ≤ 0.
std::unique_ptr<PlainIntegrator> make_extrapolation_integrator(std::unique_ptr<ForwardDynamics> dynamics,
                                                               int coordinates, int parts, double tolerance,
                                                               std::string_view kernel);

}  // namespace pendula
