#pragma once

/// What the series of chains and those of kernels have in common.
namespace pendula::detail {

/// No series has a higher order than for this tolerance of its steps.
inline constexpr double finest_of_series = 1e-17;
/// Of the radius of convergence, log₂ in units of time: where no term is seen.
inline constexpr double largest_log_radius = 1e3;
/// A step as long as its series allows.
inline constexpr double unlimited_step = 1e300;

}  // namespace pendula::detail
