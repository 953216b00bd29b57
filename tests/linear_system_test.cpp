// The linear systems of Newton's iteration, against Eigen's elimination with full pivoting.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <pendula/numeric/linear_system.hpp>

#include "support/random_chain.hpp"

namespace pendula::test {
namespace {

LinearSystem system_of(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  LinearSystem system(right.size());
  system.matrix = matrix;
  system.right = right;
  system.solve();
  return system;
}

/// |A x − b|, in rounding errors of A x.
double backward_error(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& x, const Eigen::VectorXd& right) {
  const double size = matrix.cwiseAbs().rowwise().sum().maxCoeff() * x.cwiseAbs().maxCoeff();
  return (matrix * x - right).cwiseAbs().maxCoeff() / size;
}

TEST(LinearSystem, OfAnySizeIsSolvedToRounding) {
  Random random(8);
  for (int size = 1; size <= 70; ++size) {
    const auto matrix = random.matrix<Eigen::MatrixXd>(size, size, -1, 1);
    const auto right = random.matrix<Eigen::VectorXd>(size, 1, -1, 1);
    const LinearSystem system = system_of(matrix, right);
    EXPECT_LT(backward_error(matrix, system.solution, right), 1e-15) << size;  // measured 1.8e-16, below too
    const Eigen::FullPivLU<Eigen::MatrixXd> other(matrix);
    const double conditioned = 1e-15 / other.rcond();  // measured 2.5e-17
    EXPECT_LT((system.solution - other.solve(right)).norm() / system.solution.norm(), conditioned) << size;
  }
}

// Scaled rows and zeros on the diagonal: without pivots nothing would be left of these.
TEST(LinearSystem, IsPivoted) {
  Random random(9);
  for (int size = 2; size <= 40; ++size) {
    auto matrix = random.matrix<Eigen::MatrixXd>(size, size, -1, 1);
    matrix.diagonal().setZero();
    const auto right = random.matrix<Eigen::VectorXd>(size, 1, -1, 1);
    EXPECT_LT(backward_error(matrix, system_of(matrix, right).solution, right), 1e-15) << size;
    matrix.diagonal().setConstant(1e-18);
    EXPECT_LT(backward_error(matrix, system_of(matrix, right).solution, right), 1e-15) << size;
  }
}

TEST(LinearSystem, ThatIsSingularHasNoFiniteSolution) {
  EXPECT_FALSE(system_of(Eigen::Matrix3d::Zero(), Eigen::Vector3d::Ones()).solution.allFinite());
  Eigen::Matrix3d matrix;
  matrix << 1, 2, 3, 2, 4, 6, 1, 0, 1;
  EXPECT_FALSE(system_of(matrix, Eigen::Vector3d(1, 3, 1)).solution.allFinite());
  EXPECT_FALSE(system_of(matrix, Eigen::Vector3d(1, 2, 1)).solution.allFinite());
  matrix(1, 1) = std::nan("");
  EXPECT_FALSE(system_of(matrix, Eigen::Vector3d(1, 2, 1)).solution.allFinite());
}

}  // namespace
}  // namespace pendula::test
