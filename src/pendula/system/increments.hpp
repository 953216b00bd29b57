#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/numeric/lanes.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula::detail {

/// Replaces increments of stages by h b times the rates that were `found`, both (rows, W); says how far they change.
template <int W>
IterationChange replace_increments(const double* hb, const double* found, const double* weights, std::size_t rows,
                                   double* increments) {
  using Lanes = Pack<W, RegisterFor<W>>;
  constexpr auto width = static_cast<std::size_t>(W);
  const Lanes each_hb = Lanes::load(hb);
  Lanes largest(0.0), scale(0.0), all(0.0);
  for (std::size_t k = 0; k < rows; ++k) {
    double* const at = increments + k * width;
    const Lanes weight(weights[k]), now = each_hb * Lanes::load(found + k * width), change = now - Lanes::load(at);
    largest = max(largest, weight * abs(change));
    scale = max(scale, weight * abs(now));
    all = all + change;
    now.store(at);
  }
  const auto each_of = [](const Lanes& numbers) {
    std::array<double, width> each;
    numbers.store_unaligned(each.data());
    return each;
  };
  // A NaN change reaches the sum, though not always the maximum.
  double total = 0;
  for (const double sum : each_of(all)) total += sum;
  const double size = std::ranges::max(each_of(scale));
  return {std::isfinite(total) ? std::ranges::max(each_of(largest)) : std::numeric_limits<double>::quiet_NaN(), size};
}

}  // namespace pendula::detail
