#pragma once

#include <pendula/system/system_table.hpp>
#include <span>
#include <string_view>

namespace pendula {

/// A state of a system, and its numbers there.
struct KernelPoint {
  double time;
  std::span<const double> parameters, inputs, q, v, a;
};

/// What a check of that is called.
inline constexpr std::string_view width_line = "functions of 2, 4 and 8 states, as of one";

/// Compares the functions of a kernel of 2, 4 and 8 states with those of one, in lanes that differ: the largest
/// difference of two numbers, relative to the largest that this function gives at any of the points.
double width_error(const SystemTable& table, std::span<const KernelPoint> points);

}  // namespace pendula
