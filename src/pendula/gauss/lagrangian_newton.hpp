#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lagrangian_jacobians.hpp>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/stage_system.hpp>

namespace pendula {

/// One Newton iteration on the stages of any system in momentum form. The unknowns are the stage rates V_i:
///   Q_i = q + h Σ_j a_ij V_j,  f_j = ∂L/∂q(Q_j, V_j) + Q(Q_j, V_j, t_j),
///   residual  ∂L/∂v(Q_i, V_i) − p − h Σ_j a_ij f_j.
/// Its matrix is exact, from the kernel's generated Jacobians.
template <int Width>
class LagrangianNewton {
 public:
  using Stages = LagrangianStages<Width>;

  LagrangianNewton(std::size_t coordinates, int stages) : system_(coordinates, stages), jacobians_(coordinates) {}

  /// Improves the increments of the coordinates once. Those of the momenta are computed from the rates before the
  /// correction.
  Correction correct(Stages& stages) {
    const typename Stages::Columns& columns = stages.columns();
    jacobians_.evaluate(stages);
    push(stages);
    for (std::size_t row = 0; row < jacobians_.count(); ++row) {
      const Compensated<double>& p = stages.momentum_before(row);
      system_.set_residual(row,
                           (jacobians_.p(row) - L(p.value)) - columns.integral(stages.pushed(row), L(p.compensation)));
      for (std::size_t column = 0; column < jacobians_.count(); ++column) {
        for (std::size_t k = 0; k < system_.stages(); ++k) {
          system_.set_derivative(row, column, k, jacobians_.derivative(columns, row, column, k));
        }
      }
    }
    system_.solve();
    return apply(stages);
  }

  /// Computes the increments of the momenta from the rates as they are.
  void find_forces(Stages& stages) {
    jacobians_.evaluate_forms(stages);
    push(stages);
  }

 private:
  using L = typename Stages::L;

  void push(Stages& stages) const {
    for (std::size_t k = 0; k < jacobians_.count(); ++k) {
      (stages.columns().hb() * jacobians_.f(k)).store(stages.pushed(k));
    }
  }

  Correction apply(Stages& stages) {
    double largest = 0, scale = stages.floor();
    int worst = -1;
    for (std::size_t i = 0; i < system_.stages(); ++i) {
      for (std::size_t k = 0; k < jacobians_.count(); ++k) {
        const double advance = stages.columns().hb(i) * system_.correction(k, i);
        if (!std::isfinite(advance)) return {std::numeric_limits<double>::quiet_NaN(), static_cast<int>(k)};
        double& moved = stages.moved(k)[i];
        moved -= advance;
        const double size = stages.weight(k) * std::abs(advance);
        scale = std::max({scale, stages.weight(k) * std::abs(moved),
                          std::abs(stages.columns().h() * stages.pushed(k)[i]) / stages.weight(k)});
        if (size < largest) continue;
        largest = size;
        worst = static_cast<int>(k);
      }
    }
    return {largest > 0 ? largest / scale : 0, worst};
  }

  detail::StageSystem system_;
  LagrangianJacobians<Width> jacobians_;
};

}  // namespace pendula
