#pragma once

#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace pendula {

/// A square linear system, solved by LU with partial pivoting in a workspace allocated once.
///
/// Not Eigen's, because the systems of few coordinates and stages solved here are small: Eigen's blocked LU takes twice
/// the time up to 32 unknowns, more up to 64, and five seconds of compilation per kernel.
class LinearSystem {
 public:
  using Index = Eigen::Index;

  explicit LinearSystem(Index size) : matrix(size, size), right(size), solution(size) {}

  /// Solves matrix · solution = right and leaves the factors in `matrix`. A singular matrix gives a solution that is
  /// not finite.
  void solve() {
    solution = right;
    solve(solution.data(), 1);
  }

  /// Solves for `count` right-hand sides, (size x count) column by column, each replaced by its solution.
  void solve(double* columns, Index count) {
    for (Index k = 0; k < size(); ++k) {
      bring_up_pivot(k, columns, count);
      eliminate(k, columns, count);
    }
    for (Index j = 0; j < count; ++j) substitute_back(columns + j * size());
  }

  Eigen::MatrixXd matrix;
  Eigen::VectorXd right, solution;

 private:
  Index size() const { return matrix.rows(); }
  double* column(Index j) { return matrix.data() + j * size(); }

  // A NaN pivot is not exchanged, and spreads to the solution.
  void bring_up_pivot(Index k, double* columns, Index count) {
    const double* const pivots = column(k);
    Index largest = k;
    for (Index i = k + 1; i < size(); ++i) {
      if (std::abs(pivots[i]) > std::abs(pivots[largest])) largest = i;
    }
    if (largest == k) return;
    for (Index j = k; j < size(); ++j) std::swap(column(j)[k], column(j)[largest]);
    for (Index j = 0; j < count; ++j) std::swap(columns[j * size() + k], columns[j * size() + largest]);
  }

  // Two columns at a time, so that the multipliers are read once for both.
  void eliminate(Index k, double* columns, Index count) {
    double* const multipliers = column(k);
    const double inverse = 1 / multipliers[k];
    for (Index i = k + 1; i < size(); ++i) multipliers[i] *= inverse;
    Index j = k + 1;
    for (; j + 1 < size(); j += 2) {
      double *const a = column(j), *const b = column(j + 1);
      const double above_a = a[k], above_b = b[k];
      for (Index i = k + 1; i < size(); ++i) {
        a[i] -= multipliers[i] * above_a;
        b[i] -= multipliers[i] * above_b;
      }
    }
    if (j < size()) subtract(multipliers, column(j)[k], column(j), k + 1, size());
    for (Index i = 0; i < count; ++i) {
      double* const x = columns + i * size();
      subtract(multipliers, x[k], x, k + 1, size());
    }
  }

  void substitute_back(double* x) {
    for (Index k = size(); k-- > 0;) {
      x[k] /= column(k)[k];
      subtract(column(k), x[k], x, 0, k);
    }
  }

  static void subtract(const double* x, double factor, double* from, Index first, Index last) {
    for (Index i = first; i < last; ++i) from[i] -= x[i] * factor;
  }
};

}  // namespace pendula
