#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/numeric/directions.hpp>
#include <pendula/system/constraint_forces.hpp>
#include <pendula/system/parameter_slopes.hpp>
#include <pendula/system/state_slopes.hpp>
#include <pendula/system/system_model.hpp>
#include <vector>

namespace pendula {

/// Brings tangents (δq, δp) of a system at one state onto its constraints, by the least change of coordinates, as
/// masses weigh it, and by a change of momenta along Gᵀ, G = ∂g/∂q:
///   G δq = 0,  G δv + (∂(dg/dt)/∂q) δq = 0,  where δp = ∂p/∂q δq + M δv + ∂p/∂θ δθ.
/// Constraints of rates say the second alone (ConstraintForces).
class ConstraintTangents {
 public:
  explicit ConstraintTangents(const SystemModel& model)
      : n_(static_cast<Eigen::Index>(model.coordinates())),
        m_(static_cast<Eigen::Index>(model.info().constraints.size())),
        here_(model),
        forces_(model.info()),
        slopes_(model),
        by_state_(model),
        q_(n_),
        v_(n_),
        pushed_(n_, n_),
        curvature_(n_, n_) {}

  /// At the start of a step, in a state that keeps the constraints.
  void begin(double time, const double* q, const double* v) {
    go_to(time, q, v);
    curvature_.setZero();
    impulses_.resize(0);
    find();
    const Directions<> along = Directions<>::Identity(n_, n_) - moved_.transpose() * (of_positions_ * slope_);
    whole_.topLeftCorner(n_, n_) = along;
    whole_.bottomLeftCorner(n_, n_) = turning_ * along;
  }

  /// At the end of a step, which coordinates reach on the constraints. Impulses there have brought momenta onto them,
  /// along a Gᵀ that turns with δq.
  void end(double time, const double* q, const double* v, const double* impulses) {
    go_to(time, q, v);
    impulses_ = Eigen::Map<const Eigen::VectorXd>(impulses, m_);
    curvature(impulses);
    find();
  }

  /// Σ_i J_i ∂²g_i/∂q² where this is, for impulses J  (coordinates x coordinates).
  const Directions<>& curvature(const double* impulses) {
    forces_.find_curvature(here_, q_.data(), impulses, curvature_.data());
    return curvature_;
  }

  /// The linear map of (δq, δp)  (2 coordinates x 2 coordinates).
  const Directions<>& whole() const { return whole_; }

  /// What it adds for variations of the parameters, then of the inputs  (2 coordinates x parameters).
  Directions<> by_parameters() {
    slopes_.evaluate(time_, q_.data(), v_.data());
    slopes_.evaluate_constraints(time_, q_.data(), v_.data());
    Directions<> found = Directions<>::Zero(2 * n_, slopes_.p.cols());
    found.bottomRows(n_) = pushed_ * slopes_.p - resisted_ * slopes_.g_dot;
    if (impulses_.size() > 0) {
      const Directions<> turned = slopes_.turned(impulses_);
      found.bottomRows(n_) += turned - pushed_ * turned;
    } else {
      found.topRows(n_) = -moved_.transpose() * (of_positions_ * slopes_.g);
      found.bottomRows(n_) += turning_ * found.topRows(n_);
    }
    return found;
  }

 private:
  void go_to(double time, const double* q, const double* v) {
    time_ = time;
    q_ = Eigen::Map<const Eigen::VectorXd>(q, n_);
    v_ = Eigen::Map<const Eigen::VectorXd>(v, n_);
    here_.set_time(time);
    forces_.look(here_, q_.data());
  }

  void find() {
    slope_.resize(m_, n_);
    moved_.resize(m_, n_);
    inverse_.resize(m_, m_);
    for (Eigen::Index i = 0; i < m_; ++i) {
      const auto row = static_cast<std::size_t>(i);
      for (Eigen::Index k = 0; k < n_; ++k) {
        slope_(i, k) = forces_.slope(row, static_cast<std::size_t>(k));
        moved_(i, k) = forces_.moved(row, static_cast<std::size_t>(k));
      }
      for (Eigen::Index j = 0; j < m_; ++j) inverse_(i, j) = forces_.inverse(row, static_cast<std::size_t>(j));
    }
    of_positions_.resize(m_, m_);
    forces_.find_inverse_of_positions(of_positions_.data());
    Directions<> p_D_q(n_, n_), p_D_v(n_, n_), f_D_q(n_, n_), f_D_v(n_, n_);
    Eigen::VectorXd p(n_), f(n_);
    const Directions<> rates = by_state_.constraint_rates(time_, q_.data(), v_.data()).first.leftCols(n_);
    here_(&SystemFunctions::momentum_form_with_jacobians, q_.data(), v_.data(), p.data(), f.data(), p_D_q.data(),
          p_D_v.data(), f_D_q.data(), f_D_v.data());
    resisted_ = slope_.transpose() * inverse_;
    pushed_ = resisted_ * moved_;
    turning_ = curvature_ + pushed_ * (p_D_q - curvature_) - resisted_ * rates;
    whole_.setIdentity(2 * n_, 2 * n_);
    whole_.bottomRightCorner(n_, n_) -= pushed_;
    whole_.bottomLeftCorner(n_, n_) = turning_;
  }

  Eigen::Index n_, m_;
  SystemAt<1> here_;
  ConstraintForces forces_;
  ParameterSlopes slopes_;
  StateSlopes by_state_;
  double time_ = 0;
  Eigen::VectorXd q_, v_, impulses_;
  Directions<> slope_, moved_, inverse_, of_positions_;  // G, G M⁻¹, K⁻¹, that of constraints of positions alone
  Directions<> resisted_, pushed_, turning_;  // Gᵀ K⁻¹, Gᵀ K⁻¹ G M⁻¹, what δq on the constraints brings to δp
  Directions<> curvature_, whole_;
};

}  // namespace pendula
