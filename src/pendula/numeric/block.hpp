#pragma once

#include <cstddef>
#include <pendula/numeric/lanes.hpp>

namespace pendula {

namespace detail {

/// Numbers in a pack that holds a row of `count`: a power of two, or a multiple of four, where there are registers.
template <class Real>
constexpr std::size_t padded_row(std::size_t count) {
  if (!has_registers<Real>) return count;
  return count <= 2 ? count : (count + 3) / 4 * 4;
}

/// A small matrix, row by row, its rows padded to packs. Rows are written whole where they are read whole soon after: a
/// processor hands on what it has just stored, but not a row that was stored in pieces.
template <std::size_t Rows, std::size_t Columns, class Real>
struct Block {
  static constexpr std::size_t stride = padded_row<Real>(Columns);
  // Small blocks wait for one another, and registers of four hand on quicker than registers of eight.
  static constexpr int widest = stride <= 8 ? 4 : 8;
  using Row = Pack<static_cast<int>(stride), RegisterFor<static_cast<int>(stride), Real, widest>>;

  alignas(pack_alignment) Real values[Rows][stride];

  Real* operator[](std::size_t row) { return values[row]; }
  const Real* operator[](std::size_t row) const { return values[row]; }
  Row row(std::size_t i) const { return Row::load(values[i]); }
  void set_row(std::size_t i, const Row& row) { row.store(values[i]); }

  /// x in column k, zero elsewhere.
  static Row unit(std::size_t k, const Real& x) { return Row(x) * Row::load(units.values[k]); }

 private:
  struct Units {
    alignas(pack_alignment) Real values[Columns][stride] = {};
    constexpr Units() {
      for (std::size_t k = 0; k < Columns; ++k) values[k][k] = Real(1);
    }
  };
  static inline const Units units;
};

/// The row a times B, added to `start`; two sums side by side, so that one does not wait for the other.
template <std::size_t Inner, std::size_t Columns, class Real>
auto row_of_product(const Real* a, const Block<Inner, Columns, Real>& b,
                    const typename Block<Inner, Columns, Real>::Row& start) {
  using Row = typename Block<Inner, Columns, Real>::Row;
  Row even = fma(Row(a[0]), b.row(0), start);
  if constexpr (Inner == 1) return even;
  Row odd = Row(a[1]) * b.row(1);
  for (std::size_t k = 2; k + 1 < Inner; k += 2) {
    even = fma(Row(a[k]), b.row(k), even);
    odd = fma(Row(a[k + 1]), b.row(k + 1), odd);
  }
  if (Inner % 2 == 1) even = fma(Row(a[Inner - 1]), b.row(Inner - 1), even);
  return even + odd;
}

/// C = A B.
template <std::size_t M, std::size_t Inner, std::size_t Columns, class Real>
void set_product(const Block<M, Inner, Real>& a, const Block<Inner, Columns, Real>& b, Block<M, Columns, Real>& c) {
  using Row = typename Block<M, Columns, Real>::Row;
  for (std::size_t i = 0; i < M; ++i) c.set_row(i, row_of_product(a[i], b, Row(Real(0))));
}

/// C = a B.
template <std::size_t M, std::size_t Columns, class Real>
void set_scaled(const Real& a, const Block<M, Columns, Real>& b, Block<M, Columns, Real>& c) {
  using Row = typename Block<M, Columns, Real>::Row;
  for (std::size_t i = 0; i < M; ++i) c.set_row(i, Row(a) * b.row(i));
}

/// C += A B.
template <std::size_t M, std::size_t Inner, std::size_t Columns, class Real>
void add_product(const Block<M, Inner, Real>& a, const Block<Inner, Columns, Real>& b, Block<M, Columns, Real>& c) {
  for (std::size_t i = 0; i < M; ++i) c.set_row(i, row_of_product(a[i], b, c.row(i)));
}

/// Replaces the square of S from (k, k) on, of one row or of two, by the negative of its inverse: one division either
/// way. Tells whether its pivots are positive.
template <std::size_t M, std::size_t Wide, class Real>
bool invert_negated(Block<M, Wide, Real>& S, std::size_t k) {
  if (k + 1 == M) {
    const bool positive = S[k][k] > 0;
    S[k][k] = -1 / S[k][k];
    return positive;
  }
  const Real a = S[k][k], b = S[k][k + 1], c = S[k + 1][k], d = S[k + 1][k + 1];
  const Real determinant = a * d - b * c;
  const Real inverse = -1 / determinant;
  S[k][k] = d * inverse;
  S[k][k + 1] = -b * inverse;
  S[k + 1][k] = -c * inverse;
  S[k + 1][k + 1] = a * inverse;
  return a > 0 && determinant > 0;
}

/// Y_i += a Y_k + b Y_{k+1}.
template <std::size_t M, std::size_t Columns, class Real>
void add_rows(Block<M, Columns, Real>& Y, std::size_t i, std::size_t k, const Real& a, const Real& b) {
  using Row = typename Block<M, Columns, Real>::Row;
  Y.set_row(i, fma(Row(a), Y.row(k), fma(Row(b), Y.row(k + 1), Y.row(i))));
}

/// Row k of S from the diagonal on, and the row after it: what back substitution needs of them.
template <std::size_t M, class Real>
struct PivotRows {
  Real values[2][M];

  template <std::size_t Wide>
  PivotRows(const Block<M, Wide, Real>& S, std::size_t k) {
    for (std::size_t row = 0; row < 2 && k + row < M; ++row) {
      for (std::size_t j = k; j < M; ++j) values[row][j] = S[k + row][j];
    }
  }
};

/// Y_k from the rows after it, by rows of S whose diagonal squares are negative inverses; of one row or of two.
template <std::size_t M, std::size_t Columns, class Real>
void substitute_back(const PivotRows<M, Real>& pivot, Block<M, Columns, Real>& Y, std::size_t k) {
  using Row = typename Block<M, Columns, Real>::Row;
  const auto& S = pivot.values;
  Row first = Y.row(k);
  if (k + 1 == M) return Y.set_row(k, Row(S[0][k]) * first);
  Row second = Y.row(k + 1);
  for (std::size_t j = k + 2; j < M; ++j) {
    first = fma(Row(S[0][j]), Y.row(j), first);
    second = fma(Row(S[1][j]), Y.row(j), second);
  }
  Y.set_row(k, fma(Row(S[0][k]), first, Row(S[0][k + 1]) * second));
  Y.set_row(k + 1, fma(Row(S[1][k]), first, Row(S[1][k + 1]) * second));
}

/// Replaces every Y by −S⁻¹ Y, two rows at a time, and the columns of S behind its square too. No pivoting: S is
/// positive definite but for terms of the order of the step. Tells whether all pivots are positive, as they are of
/// steps that are not too large.
template <std::size_t M, std::size_t Wide, class Real, std::size_t... Columns>
bool solve_negated(Block<M, Wide, Real>& S, Block<M, Columns, Real>&... Y) {
  bool positive = true;
  for (std::size_t k = 0; k < M; k += 2) {
    positive = invert_negated(S, k) && positive;
    for (std::size_t i = k + 2; i < M; ++i) {
      const Real first = S[i][k] * S[k][k] + S[i][k + 1] * S[k + 1][k];
      const Real second = S[i][k] * S[k][k + 1] + S[i][k + 1] * S[k + 1][k + 1];
      add_rows(S, i, k, first, second);
      (add_rows(Y, i, k, first, second), ...);
    }
  }
  for (std::size_t done = M % 2 == 0 ? 2 : 1; done <= M; done += 2) {
    const PivotRows<M, Real> pivot(S, M - done);
    if constexpr (Wide > M) substitute_back(pivot, S, M - done);
    (substitute_back(pivot, Y, M - done), ...);
  }
  return positive;
}

}  // namespace detail

}  // namespace pendula
