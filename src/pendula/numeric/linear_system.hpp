#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

namespace pendula {

/// A square linear system, solved by LU with partial pivoting in a workspace that is made once.
template <int Size = Eigen::Dynamic>
class LinearSystem {
 public:
  using Matrix = Eigen::Matrix<double, Size, Size>;
  using Vector = Eigen::Matrix<double, Size, 1>;

  explicit LinearSystem(Eigen::Index size);

  /// Solves matrix · solution = right. A singular matrix gives a solution that is not finite.
  void solve();

  Matrix matrix;
  Vector right, solution;

 private:
  Eigen::PartialPivLU<Matrix> lu_;
};

template <int Size>
LinearSystem<Size>::LinearSystem(Eigen::Index size) : matrix(size, size), right(size), solution(size), lu_(size) {}

template <int Size>
void LinearSystem<Size>::solve() {
  lu_.compute(matrix);
  solution = lu_.solve(right);
}

#ifdef PENDULA_LIBRARY
// Compiled once in a copy of the library: it is a good part of the compile time of every kernel otherwise.
extern template class LinearSystem<Eigen::Dynamic>;
#endif

}  // namespace pendula
