#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula {

template <int Width>
class VelocityJacobians;

/// The paper's form of the equations of motion, E(q, v, a, t) = 0, with rates v where MomentumForm has momenta: Gauss
/// methods are symmetric in it, but not symplectic. Newton solves for the stage accelerations, so that the mass matrix
/// is never inverted.
struct VelocityForm {
  static constexpr bool is_symplectic = false, has_fixed_point = false;
  static constexpr int unknown = 1;
  template <int Width>
  using Equations = VelocityJacobians<Width>;

  template <class Call>
  static void from_rates(Call&& /*call*/, std::size_t count, const double* /*q*/, const double* v, double* found) {
    std::copy_n(v, count, found);
  }
  template <class Call>
  static void rates(Call&& /*call*/, std::size_t count, const double* /*q*/, const double* given, double* v) {
    std::copy_n(given, count, v);
  }
  template <class Call>
  static void field(Call&& call, std::size_t count, const double* q, const double* given, double* v, double* a) {
    std::copy_n(given, count, v);
    call(&SystemFunctions::acceleration, q, v, a);
  }

  static double size(double change, double weight) { return change * weight; }
};

/// The stage equations of Newton in velocity form, E(Q_i, V_i, K_i, t_i) = 0 (paper eq. 27) with
///   Q_i = q + h c_i v + h² Σ_j (A²)_ij K_j,  V_i = v + h Σ_j a_ij K_j.
template <int Width>
class VelocityJacobians {
 public:
  using Stages = LagrangianStages<Width, VelocityForm>;
  using L = typename Stages::L;

  explicit VelocityJacobians(std::size_t coordinates)
      : count_(coordinates), vectors_(4 * count_), matrices_(3 * count_ * count_), squared_(Width) {}

  std::size_t count() const { return count_; }

  /// Evaluates the equations and their derivatives at the stages.
  void linearize(Stages& stages) {
    follow(stages);
    const L inverse_h = L(1.0 / stages.h()) * stages.columns().inverse_weight(0);
    for (std::size_t k = 0; k < count_; ++k) {
      stages.position(k).store(vectors_[k]);
      (inverse_h * L::load(stages.pushed(k))).store(vectors_[2 * count_ + k]);
    }
    for (int k = 0; k < stages.stages(); ++k) {
      const L ha = stages.columns().ha(static_cast<std::size_t>(k));
      stages.columns().integral(stages.columns().hb() * ha).store(squared_[k]);
    }
    stages.at_stages()(&SystemFunctions::residual_with_jacobians, vectors_[0], vectors_[count_], vectors_[2 * count_],
                       vectors_[3 * count_], matrices_[0], matrices_[count_ * count_], matrices_[2 * count_ * count_]);
  }

  /// Computes the increments of the coordinates from the present accelerations.
  void follow(Stages& stages) {
    for (std::size_t k = 0; k < count_; ++k) {
      const L v = stages.momentum(k);
      v.store(vectors_[count_ + k]);
      (stages.columns().hb() * v).store(stages.moved(k));
    }
  }

  L residual(const Stages& /*stages*/, std::size_t row) const { return L::load(vectors_[3 * count_ + row]); }

  /// ∂(residual of row, stage i)/∂(K of column, stage k) for all i.
  L derivative(const typename Stages::Columns& columns, std::size_t row, std::size_t column, std::size_t k) const {
    const L through_q =
        fma(L::load(squared_[k]), L::load(entry(0, row, column)), L(entry(2, row, column)[k]) * columns.unit(k));
    return fma(columns.ha(k), L::load(entry(1, row, column)), through_q);
  }

 private:
  const double* entry(std::size_t which, std::size_t i, std::size_t j) const {
    return matrices_[(which * count_ + i) * count_ + j];
  }

  std::size_t count_;
  typename Stages::Rows vectors_;   // Q, V, K, E
  typename Stages::Rows matrices_;  // ∂E/∂q, ∂E/∂v, ∂E/∂a
  typename Stages::Rows squared_;   // h² A², column by column
};

}  // namespace pendula
