#pragma once

#include <cstddef>

namespace pendula {

/// The Taylor series of a kernel's motions (pendula_codegen/series.py), and what memory they take; all zero if the
/// kernel has none.
struct SeriesInfo {
  bool has_momenta = false;  ///< whether a state is q, p; else q, v
  int sums = 0;              ///< number of sums Σ A_j B_(k−j) in each order k
  int operands = 0;          ///< number of series A, B in these sums
  int kept = 0;              ///< numbers that the first order computes once for all orders
};

/// The operands A, B of a sum, by their indices.
struct SeriesSum {
  unsigned short first, second;
};

namespace detail {

constexpr std::size_t to_multiple_of_8(std::size_t count) {
  return (count + 7) / 8 * 8;
}

}  // namespace detail

/// How many lanes the sums of one motion take.
constexpr std::size_t series_lanes(const SeriesInfo& info) {
  return detail::to_multiple_of_8(static_cast<std::size_t>(info.sums));
}

/// Numbers in a row of SeriesRows::state, for W motions. A row of one motion is padded to fill registers.
constexpr std::size_t series_state_row(std::size_t coordinates, std::size_t W) {
  if (W > 1) return 2 * coordinates * W;
  return coordinates <= 2 ? 4 : detail::to_multiple_of_8(2 * coordinates);
}

/// Numbers in a row of SeriesRows::operands, for W motions. Of one motion, the first operands of all sums come first,
/// then the second ones.
constexpr std::size_t series_operand_row(const SeriesInfo& info, std::size_t W) {
  return W > 1 ? static_cast<std::size_t>(info.operands) * W : 2 * series_lanes(info);
}

}  // namespace pendula
