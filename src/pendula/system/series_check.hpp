#pragma once

#include <pendula/system/kernel_widths.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <string_view>

namespace pendula {

/// Name of the check that series_error belongs to.
inline constexpr std::string_view series_line = "Taylor series, by the equations that they solve";

/// How far the Taylor series of a kernel, of 1, 2, 4 and 8 motions from these points, are from solving its equations of
/// motion: differences of accelerations at small fractions of the radius of convergence, relative to their size. What
/// nine of ten points stay below, since a series says nothing of what is narrow and ahead of its point. 0 without
/// series.
double series_error(const SystemTable& table, std::span<const KernelPoint> points);

}  // namespace pendula
