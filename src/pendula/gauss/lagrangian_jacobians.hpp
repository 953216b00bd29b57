#pragma once

#include <cstddef>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/momentum_form.hpp>
#include <pendula/numeric/compensated.hpp>

namespace pendula {

/// The stage equations of Newton in momentum form, for the stage rates V_i, by the kernel's generated Jacobians:
///   Q_i = q + h Σ_j a_ij V_j,  f_j = ∂L/∂q(Q_j, V_j) + Q(Q_j, V_j, t_j),
///   residual  ∂L/∂v(Q_i, V_i) − p − h Σ_j a_ij f_j.
/// p and f at the stages and their derivatives have all stages of one number in the lanes of a pack.
template <int Width>
class LagrangianJacobians {
 public:
  using Stages = LagrangianStages<Width, MomentumForm>;
  using L = typename Stages::L;
  using Rows = typename Stages::Rows;

  explicit LagrangianJacobians(std::size_t coordinates)
      : count_(coordinates), vectors_(4 * count_), matrices_(4 * count_ * count_) {}

  std::size_t count() const { return count_; }

  /// Coordinates and rates of the stages as they are.
  void place(const Stages& stages) {
    alignas(pack_alignment) typename Stages::Stored inverse = {};  // beyond the stages nothing moves
    for (std::size_t j = 0; j < static_cast<std::size_t>(stages.stages()); ++j) inverse[j] = 1 / stages.columns().hb(j);
    for (std::size_t k = 0; k < count_; ++k) {
      stages.position(k).store(vectors_[k]);
      (L::load(inverse) * L::load(stages.moved(k))).store(vectors_[count_ + k]);
    }
  }

  /// Evaluates p, f and their derivatives at the stages.
  void evaluate(const Stages& stages) {
    place(stages);
    stages.at_stages()(&SystemFunctions::momentum_form_with_jacobians, q(), v(), vector(2), vector(3), matrix(0),
                       matrix(1), matrix(2), matrix(3));
  }

  /// Evaluates the equations of Newton and their derivatives at the stages.
  void linearize(Stages& stages) {
    evaluate(stages);
    push(stages);
  }

  /// Computes the increments of the momenta from the rates as they are.
  void follow(Stages& stages) {
    place(stages);
    stages.at_stages()(&SystemFunctions::momentum_form, q(), v(), vector(2), vector(3));
    push(stages);
  }

  L residual(const Stages& stages, std::size_t row) const {
    const Compensated<double>& before = stages.momentum_before(row);
    return (p(row) - L(before.value)) - stages.columns().integral(stages.pushed(row), L(before.compensation));
  }

  const double* q() const { return vectors_[0]; }
  const double* v() const { return vectors_[count_]; }
  L p(std::size_t k) const { return L::load(vectors_[2 * count_ + k]); }
  L f(std::size_t k) const { return L::load(vectors_[3 * count_ + k]); }
  L p_D_q(std::size_t i, std::size_t j) const { return L::load(entry(0, i, j)); }
  L p_D_v(std::size_t i, std::size_t j) const { return L::load(entry(1, i, j)); }
  L f_D_q(std::size_t i, std::size_t j) const { return L::load(entry(2, i, j)); }
  L f_D_v(std::size_t i, std::size_t j) const { return L::load(entry(3, i, j)); }

  /// ∂(residual of row, stage i)/∂(V of column, stage k) of all i, by the chain rule through Q_j = … + h a_jk V_k.
  L derivative(const typename Stages::Columns& columns, std::size_t row, std::size_t column, std::size_t k) const {
    const L ha = columns.ha(k), through_q = columns.integral(columns.hb() * (ha * f_D_q(row, column)));
    const L direct = ha * (p_D_q(row, column) - L(entry(3, row, column)[k]));
    return fma(L(entry(1, row, column)[k]), columns.unit(k), direct - through_q);
  }

 private:
  void push(Stages& stages) const {
    for (std::size_t k = 0; k < count_; ++k) (stages.columns().hb() * f(k)).store(stages.pushed(k));
  }

  double* vector(std::size_t which) { return vectors_[which * count_]; }
  double* matrix(std::size_t which) { return matrices_[which * count_ * count_]; }
  const double* entry(std::size_t which, std::size_t i, std::size_t j) const {
    return matrices_[(which * count_ + i) * count_ + j];
  }

  std::size_t count_;
  Rows vectors_;   // q, v, p, f
  Rows matrices_;  // ∂p/∂q, ∂p/∂v, ∂f/∂q, ∂f/∂v
};

}  // namespace pendula
