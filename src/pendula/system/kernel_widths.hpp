#pragma once

#include <pendula/system/system_table.hpp>
#include <span>
#include <string_view>

namespace pendula {

/// A state of a system, with its parameters and inputs.
struct KernelPoint {
  double time;
  std::span<const double> parameters, inputs, q, v, a;
};

/// Name of the check that width_error belongs to.
inline constexpr std::string_view width_line = "functions of 2, 4 and 8 states, as of one";

/// Compares the functions of 2, 4 and 8 states with those of one, with different states in the lanes. Returns the
/// largest difference, relative to the largest number that the function returns at any of the points.
double width_error(const SystemTable& table, std::span<const KernelPoint> points);

}  // namespace pendula
