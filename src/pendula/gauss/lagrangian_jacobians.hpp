#pragma once

#include <cstddef>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <vector>

namespace pendula {

/// What the kernel's generated Jacobians make of the stage equations of any system in momentum form: p and f at the
/// stages and their derivatives, and the exact matrix of the equations for the stage rates V (lagrangian_newton.hpp).
template <System S, int Width>
class LagrangianJacobians {
 public:
  using Stages = LagrangianStages<S, Width>;
  using Vector = typename Stages::Vector;
  using Matrix = typename Stages::Matrix;

  struct Stage {
    Vector q, v, p, f;
    Matrix p_D_q, p_D_v, f_D_q, f_D_v;
  };

  explicit LagrangianJacobians(int stages) : at_(static_cast<std::size_t>(stages)) {}

  int stages() const { return static_cast<int>(at_.size()); }
  Stage& operator[](int i) { return at_[index(i)]; }
  const Stage& operator[](int i) const { return at_[index(i)]; }

  /// Coordinates and rates of the stages as they are.
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

  /// All of it.
  void evaluate(const Stages& stages) {
    place(stages);
    for (int i = 0; i < stages.stages(); ++i) {
      Stage& at = at_[index(i)];
      const double time = stages.time_of(i);
      S::momentum_form_with_jacobians(stages.model().parameters(time), at.q, at.v, stages.model().inputs(time), at.p,
                                      at.f, at.p_D_q, at.p_D_v, at.f_D_q, at.f_D_v);
    }
  }

  /// ∂(residual i)/∂V_k, by the chain rule through Q_j = … + h a_jk V_k.
  Matrix block(const typename Stages::Columns& columns, int i, int k) const {
    Matrix block = columns.ha(index(i), index(k)) * (at_[index(i)].p_D_q - at_[index(k)].f_D_v);
    if (i == k) block += at_[index(i)].p_D_v;
    for (int j = 0; j < columns.stages(); ++j) {
      block -= (columns.ha(index(i), index(j)) * columns.ha(index(j), index(k))) * at_[index(j)].f_D_q;
    }
    return block;
  }

 private:
  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  static constexpr std::size_t index(int j) { return static_cast<std::size_t>(j); }

  std::vector<Stage> at_;
};

}  // namespace pendula
