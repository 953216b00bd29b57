#pragma once

/// Limits of the series of chains and of kernels.
namespace pendula::detail {

/// The order of a series follows from the tolerance of its steps, but at least from this one.
inline constexpr double finest_of_series = 1e-17;
/// Largest log₂ of the radius of convergence in units of time: where all last terms vanish.
inline constexpr double largest_log_radius = 1e3;
/// A limit that leaves a step as long as its series allows  [s].
inline constexpr double unlimited_step = 1e300;

}  // namespace pendula::detail
