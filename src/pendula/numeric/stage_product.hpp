#pragma once

#include <cstddef>
#include <pendula/numeric/lanes.hpp>

namespace pendula::detail {

/// start + Σ_j column_j x_j, where `columns` holds `Columns` columns of `Width` numbers each. Two partial sums, so that
/// consecutive products do not wait for each other.
template <class L, std::size_t Columns, std::size_t Width, class Real>
[[gnu::always_inline]] inline L stage_product(const Real* columns, const Real* x, const L& start) {
  L even = fma(L(x[0]), L::load(columns), start);
  if constexpr (Columns == 1) return even;
  L odd = L(x[Columns > 1]) * L::load(columns + (Columns > 1 ? Width : 0));
  for (std::size_t j = 2; j < Columns; j += 2) {
    even = fma(L(x[j]), L::load(columns + j * Width), even);
    if (j + 1 < Columns) odd = fma(L(x[j + 1]), L::load(columns + (j + 1) * Width), odd);
  }
  return even + odd;
}

}  // namespace pendula::detail
