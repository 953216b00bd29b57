#pragma once

#include <cstddef>
#include <pendula/numeric/lanes.hpp>

namespace pendula {

namespace detail {

/// Length of a stored row of `count` numbers: rounded up to 1, 2 or a multiple of 4 where Real has SIMD registers.
template <class Real>
constexpr std::size_t padded_row(std::size_t count) {
  if (!has_registers<Real>) return count;
  return count <= 2 ? count : (count + 3) / 4 * 4;
}

/// A small matrix stored row by row, its rows padded to whole packs. Rows that are read soon are written whole: a
/// processor forwards a store to a load of the same width, but not several narrower stores to a wider load.
template <std::size_t Rows, std::size_t Columns, class Real>
struct Block {
  static constexpr std::size_t stride = padded_row<Real>(Columns);
  // Operations on small blocks wait for one another, and results in registers of four are ready sooner than in
  // registers of eight.
  static constexpr int widest = stride <= 8 ? 4 : 8;
  using Row = Pack<static_cast<int>(stride), RegisterFor<static_cast<int>(stride), Real, widest>>;

  alignas(pack_alignment) Real values[Rows][stride];

  Real* operator[](std::size_t row) { return values[row]; }
  const Real* operator[](std::size_t row) const { return values[row]; }
  Row row(std::size_t i) const { return Row::load(values[i]); }
  void set_row(std::size_t i, const Row& row) { row.store(values[i]); }

  /// The row with x in column k and zero elsewhere.
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

/// start + a B for the row a. Two partial sums, so that consecutive products do not wait for each other.
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

/// Replaces the 1 x 1 or 2 x 2 diagonal block of S at (k, k) by the negative of its inverse, with one division. Returns
/// whether its pivots are positive.
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

/// Rows k and k + 1 of S from column k on, as back substitution reads them.
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

/// Back substitution for rows k and k + 1 of Y (row k alone where it is the last); the diagonal blocks of S hold their
/// negative inverses.
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

/// Replaces each Y, and the columns of S beyond its square part, by −S⁻¹ Y, by elimination of two rows at a time. It
/// does not pivot: S is positive definite up to terms of the order of the step size. Returns whether all pivots are
/// positive, as they are unless the step is too large.
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
