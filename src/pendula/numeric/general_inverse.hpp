#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <cmath>
#include <pendula/numeric/linear_system.hpp>

namespace pendula {

/// The inverse X of a square matrix A; where rows of A depend on one another, one of those X with A X A = A. Then X b
/// solves A x = b for every b that has a solution.
class GeneralInverse {
 public:
  using Index = Eigen::Index;

  explicit GeneralInverse(Index size) : matrix(size, size), system_(size) {}

  /// Writes X, column by column. Returns how many rows of A do not follow from others.
  Index find(double* inverse) {
    const Index size = matrix.rows();
    Eigen::Map<Eigen::MatrixXd> found(inverse, size, size);
    found.setIdentity();
    system_.matrix = matrix;
    system_.solve(inverse, size);
    const auto pivots = system_.matrix.diagonal().cwiseAbs();
    if (size == 0 || pivots.minCoeff() > least_pivot * pivots.maxCoeff()) return size;
    return find_of_fewer(found);
  }

  Eigen::MatrixXd matrix;

 private:
  static constexpr double least_pivot = 1e-10;

  // Rows and columns are scaled, so that units of constraints do not decide which of them depend on others.
  Index find_of_fewer(Eigen::Map<Eigen::MatrixXd>& found) {
    if (!matrix.allFinite()) return matrix.rows();
    const Eigen::VectorXd sizes = matrix.diagonal().cwiseAbs().cwiseSqrt();
    const Eigen::VectorXd scale = (sizes.array() > 0).select(sizes.cwiseInverse(), 1.0);
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factors;
    factors.setThreshold(least_pivot);
    factors.compute(scale.asDiagonal() * matrix * scale.asDiagonal());
    found = scale.asDiagonal() * factors.pseudoInverse() * scale.asDiagonal();
    return factors.rank();
  }

  LinearSystem system_;
};

}  // namespace pendula
