#pragma once

#include <algorithm>
#include <cstddef>

namespace pendula::detail {

/// y_i += Σ_j entry(i, j) x_j for rows x, y of packs: many right-hand sides at once, four rows of y kept in registers.
template <std::size_t Rows, std::size_t Columns, class Row, class Entry>
void add_product_of(Entry entry, const Row* x, Row* y) {
  constexpr std::size_t together = 4;
  for (std::size_t begin = 0; begin < Rows; begin += together) {
    const std::size_t count = std::min(together, Rows - begin);
    Row sums[together];
    for (std::size_t i = 0; i < count; ++i) sums[i] = y[begin + i];
    for (std::size_t j = 0; j < Columns; ++j) {
      for (std::size_t i = 0; i < count; ++i) sums[i] = fma(Row(entry(begin + i, j)), x[j], sums[i]);
    }
    for (std::size_t i = 0; i < count; ++i) y[begin + i] = sums[i];
  }
}

/// y += A x for a small matrix A.
template <std::size_t Rows, std::size_t Columns, class Real, class Row>
void add_product(const Real (&a)[Rows][Columns], const Row* x, Row* y) {
  add_product_of<Rows, Columns>([&](std::size_t i, std::size_t j) { return a[i][j]; }, x, y);
}

/// y += Aᵀ x.
template <std::size_t Rows, std::size_t Columns, class Real, class Row>
void add_transposed_product(const Real (&a)[Rows][Columns], const Row* x, Row* y) {
  add_product_of<Columns, Rows>([&](std::size_t i, std::size_t j) { return a[j][i]; }, x, y);
}

}  // namespace pendula::detail
