#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/stage_system.hpp>
#include <vector>

namespace pendula {

/// One Newton iteration on the stages of any system in momentum form. Unknown are the stage rates V_i:
///   Q_i = q + h Σ_j a_ij V_j,  residual ∂L/∂v(Q_i, V_i) − p − h Σ_j a_ij f_j,  f_j = ∂L/∂q(Q_j, V_j) + Q(Q_j, V_j,
///   t_j).
/// The matrix is the exact one, from the kernel's generated Jacobians.
template <System S, int Width>
class LagrangianNewton {
 public:
  using Stages = LagrangianStages<S, Width>;

  explicit LagrangianNewton(int stages) : system_(stages), at_(static_cast<std::size_t>(stages)) {}

  /// Improves the increments of the coordinates once; those of the momenta are what the rates before had.
  Correction correct(Stages& stages) {
    evaluate(stages);
    for (int i = 0; i < stages.stages(); ++i) {
      system_.residual(i) = residual(stages, i);
      for (int j = 0; j < stages.stages(); ++j) system_.block(i, j) = block(stages, i, j);
    }
    system_.solve();
    return apply(stages);
  }

  /// Makes the increments of the momenta those of the rates.
  void find_forces(Stages& stages) {
    place(stages);
    for (int i = 0; i < stages.stages(); ++i) {
      Stage& at = at_[static_cast<std::size_t>(i)];
      const double time = stages.time_of(i);
      S::momentum_form(stages.model().parameters(time), at.q, at.v, stages.model().inputs(time), at.p, at.f);
      push(stages, i);
    }
  }

 private:
  using Vector = typename Stages::Vector;
  using Matrix = typename Stages::Matrix;

  struct Stage {
    Vector q, v, p, f;
    Matrix p_D_q, p_D_v, f_D_q, f_D_v;
  };

  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  static constexpr std::size_t index(int j) { return static_cast<std::size_t>(j); }

  void place(const Stages& stages) {
    alignas(pack_alignment) typename Stages::Stored q;
    for (std::size_t k = 0; k < Stages::count; ++k) {
      stages.position(k).store(q);
      for (int i = 0; i < stages.stages(); ++i) {
        at_[index(i)].q[index(k)] = q[i];
        at_[index(i)].v[index(k)] = stages.moved(k)[i] / stages.columns().hb(index(i));
      }
    }
  }

  void evaluate(Stages& stages) {
    place(stages);
    for (int i = 0; i < stages.stages(); ++i) {
      Stage& at = at_[index(i)];
      const double time = stages.time_of(i);
      S::momentum_form_with_jacobians(stages.model().parameters(time), at.q, at.v, stages.model().inputs(time), at.p,
                                      at.f, at.p_D_q, at.p_D_v, at.f_D_q, at.f_D_v);
      push(stages, i);
    }
  }

  void push(Stages& stages, int i) const {
    for (std::size_t k = 0; k < Stages::count; ++k) {
      stages.pushed(k)[i] = stages.columns().hb(index(i)) * at_[index(i)].f[index(k)];
    }
  }

  Vector residual(const Stages& stages, int i) const {
    Vector residual;
    for (std::size_t k = 0; k < Stages::count; ++k) {
      const Compensated<double>& p = stages.momentum_before(k);
      double pushed = p.compensation;
      for (int j = 0; j < stages.stages(); ++j) {
        pushed += stages.columns().m(index(i), index(j)) * stages.columns().hb(index(j)) * at_[index(j)].f[index(k)];
      }
      residual[index(k)] = (at_[index(i)].p[index(k)] - p.value) - pushed;
    }
    return residual;
  }

  // ∂(residual i)/∂V_k, by the chain rule through Q_j = … + h a_jk V_k.
  Matrix block(const Stages& stages, int i, int k) const {
    const auto& columns = stages.columns();
    Matrix block = columns.ha(index(i), index(k)) * (at_[index(i)].p_D_q - at_[index(k)].f_D_v);
    if (i == k) block += at_[index(i)].p_D_v;
    for (int j = 0; j < stages.stages(); ++j) {
      block -= (columns.ha(index(i), index(j)) * columns.ha(index(j), index(k))) * at_[index(j)].f_D_q;
    }
    return block;
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
  std::vector<Stage> at_;
};

}  // namespace pendula
