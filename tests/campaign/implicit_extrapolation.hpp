#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <chain_equations.hpp>
#include <cmath>

namespace reference {

using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

/// The Jacobian of equations by central differences.
template <class Equations>
void by_differences(Equations& equations, const State& y, Matrix& jacobian) {
  const auto size = static_cast<Eigen::Index>(y.size());
  jacobian.resize(size, size);
  State moved = y, ahead, behind;
  for (Eigen::Index k = 0; k < size; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const Real nudge = Real(3e-7) * (1 + std::abs(y[at]));
    moved[at] = y[at] + nudge;
    equations(moved, ahead);
    moved[at] = y[at] - nudge;
    equations(moved, behind);
    moved[at] = y[at];
    for (Eigen::Index r = 0; r < size; ++r) {
      const auto row = static_cast<std::size_t>(r);
      jacobian(r, k) = (ahead[row] - behind[row]) / (2 * nudge);
    }
  }
}

/// The linearly implicit Euler method, extrapolated (SEULEX; Hairer, Wanner, Solving Ordinary Differential Equations
/// II, IV.9): for heavy damping, where an explicit method would take steps as short as what has long died away.
template <class Equations, class Differentiate>
class ImplicitExtrapolation {
 public:
  /// `differentiate(y, matrix)` is the Jacobian of the equations.
  ImplicitExtrapolation(Equations& equations, Differentiate& differentiate, Real tolerance)
      : equations_(equations), differentiate_(differentiate), tolerance_(tolerance) {}

  /// Tries a step of `step`; where it is accurate enough moves y. Either way leaves the step to try next.
  bool try_step(State& y, Real& step) {
    differentiate_(y, jacobian_);
    for (std::size_t row = 0; row < columns; ++row) {
      euler(y, step, static_cast<int>(row) + 1, table_[row]);
      for (std::size_t column = row; column-- > 0;) {  // Aitken and Neville; the best of the row ends up in table_[0]
        const Real ratio = Real(row + 1) / Real(column + 1);
        table_[column] = table_[column + 1] + (table_[column + 1] - table_[column]) / (ratio - 1);
      }
    }
    Real error = 0;
    for (Eigen::Index k = 0; k + 1 < table_[0].size(); ++k) {
      const Real scale = 1 + std::max(std::abs(y[static_cast<std::size_t>(k)]), std::abs(table_[0][k]));
      error = std::max(error, std::abs(table_[0][k] - table_[1][k]) / scale);
    }
    const bool good = error <= tolerance_;  // false for NaN, too
    const bool known = std::isfinite(error);
    const Real change = known && error > 0 ? Real(0.8) * std::pow(tolerance_ / error, Real(1) / columns) : Real(0.1);
    if (good) std::copy(table_[0].begin(), table_[0].end(), y.begin());
    step *= std::clamp(error == 0 ? Real(4) : change, Real(0.1), Real(4));
    return good;
  }

 private:
  static constexpr std::size_t columns = 9;
  using Column = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  void euler(const State& y, Real step, int count, Column& end) {
    const auto size = static_cast<Eigen::Index>(y.size());
    const Real h = step / count;
    const Eigen::PartialPivLU<Matrix> inverse(Matrix::Identity(size, size) - h * jacobian_);
    State now = y, slope;
    for (int k = 0; k < count; ++k) {
      equations_(now, slope);
      const Column change = inverse.solve(h * Eigen::Map<const Column>(slope.data(), size));
      for (Eigen::Index r = 0; r < size; ++r) now[static_cast<std::size_t>(r)] += change[r];
    }
    end = Eigen::Map<const Column>(now.data(), size);
  }

  Equations& equations_;
  Differentiate& differentiate_;
  Real tolerance_;
  Matrix jacobian_;
  std::array<Column, columns> table_;
};

}  // namespace reference
