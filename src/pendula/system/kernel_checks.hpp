#pragma once

#include <cmath>
#include <pendula/system/system_table.hpp>
#include <span>
#include <string_view>
#include <vector>

namespace pendula {

/// One statement about a kernel, the largest error found, and the largest one allowed.
struct KernelLine {
  std::string_view what;
  double error = 0;
  double limit = 0;

  /// Keeps the larger error; NaN counts as the largest, so that the check fails.
  void keep(double found) {
    if (!std::isnan(error) && !(found <= error)) error = found;
  }
};

/// A state of a system, with its parameters and inputs.
struct KernelPoint {
  double time = 0;
  std::vector<double> parameters, inputs, q, v, a;
};

/// Five random states of a chain, with random parameters; the same for the same seed.
std::vector<KernelPoint> random_points(const SystemInfo& info, unsigned seed);

/// Name of the check that width_error belongs to.
inline constexpr std::string_view width_line = "functions of 2, 4 and 8 states, as of one";

/// Compares the functions of 2, 4 and 8 states with those of one, with different states in the lanes. Returns the
/// largest difference, relative to the largest number that the function returns at any of the points.
double width_error(const SystemTable& table, std::span<const KernelPoint> points);

/// Name of the check that series_error belongs to.
inline constexpr std::string_view series_line = "Taylor series, by the equations that they solve";

/// By how much the Taylor series of a kernel, of 1, 2, 4 and 8 motions from these points, fail to solve its equations
/// of motion: differences of accelerations at small fractions of the radius of convergence, relative to their size. The
/// result bounds nine of ten points, since a series does not show a narrow force ahead of its point. 0 without series.
double series_error(const SystemTable& table, std::span<const KernelPoint> points);

}  // namespace pendula
