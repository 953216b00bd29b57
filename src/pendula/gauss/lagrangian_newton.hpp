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

/// One Newton iteration on the stages of any system in momentum form. Unknown are the stage rates V_i:
///   Q_i = q + h Σ_j a_ij V_j,  residual ∂L/∂v(Q_i, V_i) − p − h Σ_j a_ij f_j,  f_j = ∂L/∂q(Q_j, V_j) + Q(Q_j, V_j,
///   t_j).
/// The matrix is the exact one, from the kernel's generated Jacobians.
template <System S, int Width>
class LagrangianNewton {
 public:
  using Stages = LagrangianStages<S, Width>;

  explicit LagrangianNewton(int stages) : system_(stages), jacobians_(stages) {}

  /// Improves the increments of the coordinates once; those of the momenta are what the rates before had.
  Correction correct(Stages& stages) {
    jacobians_.evaluate(stages);
    for (int i = 0; i < stages.stages(); ++i) push(stages, i);
    for (int i = 0; i < stages.stages(); ++i) {
      system_.residual(i) = residual(stages, i);
      for (int j = 0; j < stages.stages(); ++j) system_.block(i, j) = jacobians_.block(stages.columns(), i, j);
    }
    system_.solve();
    return apply(stages);
  }

  /// Makes the increments of the momenta those of the rates.
  void find_forces(Stages& stages) {
    jacobians_.place(stages);
    for (int i = 0; i < stages.stages(); ++i) {
      typename Jacobians::Stage& at = jacobians_[i];
      const double time = stages.time_of(i);
      S::momentum_form(stages.model().parameters(time), at.q, at.v, stages.model().inputs(time), at.p, at.f);
      push(stages, i);
    }
  }

 private:
  using Vector = typename Stages::Vector;

  using Jacobians = LagrangianJacobians<S, Width>;

  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  static constexpr std::size_t index(int j) { return static_cast<std::size_t>(j); }

  void push(Stages& stages, int i) const {
    for (std::size_t k = 0; k < Stages::count; ++k) {
      stages.pushed(k)[i] = stages.columns().hb(index(i)) * jacobians_[i].f[index(k)];
    }
  }

  Vector residual(const Stages& stages, int i) const {
    Vector residual;
    for (std::size_t k = 0; k < Stages::count; ++k) {
      const Compensated<double>& p = stages.momentum_before(k);
      double pushed = p.compensation;
      for (int j = 0; j < stages.stages(); ++j) {
        pushed += stages.columns().m(index(i), index(j)) * stages.columns().hb(index(j)) * jacobians_[j].f[index(k)];
      }
      residual[index(k)] = (jacobians_[i].p[index(k)] - p.value) - pushed;
    }
    return residual;
  }

  Correction apply(Stages& stages) {
    double largest = 0, scale = stages.floor();
    int worst = -1;
    for (int i = 0; i < stages.stages(); ++i) {
      const Vector change = system_.correction(i);
      for (std::size_t k = 0; k < Stages::count; ++k) {
        const double advance = stages.columns().hb(index(i)) * change[index(k)];
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

  detail::StageSystem<S::coordinates> system_;
  Jacobians jacobians_;
};

}  // namespace pendula
