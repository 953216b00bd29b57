#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cstddef>
#include <pendula/numeric/directions.hpp>
#include <pendula/system/constraint_forces.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/parameter_slopes.hpp>
#include <pendula/system/state_slopes.hpp>
#include <pendula/system/system_model.hpp>
#include <vector>

namespace pendula {

/// Converts tangents at one state of a system between the coordinates of derivatives of steps, (δq, δp), and those of
/// users, (δq, δv), both (2 coordinates x any). Where parameters vary, too, by (parameters x as many),
///   δp = ∂p/∂q δq + ∂p/∂v δv + ∂p/∂θ δθ.
/// Of rates it gives the part that keeps constraints, G δv + (∂(dg/dt)/∂q) δq + … = 0: where a body is light, the
/// impulses of heavy ones leave their rounding in its momentum.
class LagrangianVariation {
 public:
  LagrangianVariation(const SystemModel& model, const Motion& state)
      : count_(state.q.size()), p_D_q_(count_, count_), p_D_v_(count_, count_), slopes_(model) {
    SystemAt<1> here(model);
    here.set_time(state.time);
    Eigen::VectorXd p(count_), f(count_);
    Directions<> f_D_q(count_, count_), f_D_v(count_, count_);
    here(&SystemFunctions::momentum_form_with_jacobians, state.q.data(), state.v.data(), p.data(), f.data(),
         p_D_q_.data(), p_D_v_.data(), f_D_q.data(), f_D_v.data());
    slopes_.evaluate(state.time, state.q.data(), state.v.data());
    if (!model.info().constraints.empty()) look_at_constraints(model, here, state);
  }

  void tangents(const Directions<>& rates, Directions<>& tangents) const {
    tangents = rates;
    tangents.bottomRows(count_) = p_D_q_ * rates.topRows(count_) + p_D_v_ * rates.bottomRows(count_);
  }
  void tangents(const Directions<>& rates, Directions<>& tangents, const Directions<>& parameters) const {
    this->tangents(rates, tangents);
    tangents.bottomRows(count_) += slopes_.p * parameters;
  }

  void rates(const Directions<>& tangents, Directions<>& rates) const {
    rates = tangents;
    rates.bottomRows(count_) = p_D_v_.lu().solve(tangents.bottomRows(count_) - p_D_q_ * tangents.topRows(count_));
    keep_constraints(rates, Directions<>::Zero(slope_.rows(), rates.cols()));
  }
  void rates(const Directions<>& tangents, Directions<>& rates, const Directions<>& parameters) const {
    Directions<> given = tangents;
    given.bottomRows(count_) -= slopes_.p * parameters;
    this->rates(given, rates);
    if (slope_.rows() > 0) keep_constraints(rates, slopes_.g_dot * parameters);
  }

 private:
  void look_at_constraints(const SystemModel& model, SystemAt<1>& here, const Motion& state) {
    ConstraintForces forces(model.info());
    forces.look(here, state.q.data());
    const auto m = static_cast<Eigen::Index>(forces.count());
    slope_.resize(m, count_);
    Directions<> moved(count_, m), inverse(m, m);
    for (Eigen::Index i = 0; i < m; ++i) {
      const auto row = static_cast<std::size_t>(i);
      for (Eigen::Index k = 0; k < count_; ++k) {
        slope_(i, k) = forces.slope(row, static_cast<std::size_t>(k));
        moved(k, i) = forces.moved(row, static_cast<std::size_t>(k));
      }
      for (Eigen::Index j = 0; j < m; ++j) inverse(i, j) = forces.inverse(row, static_cast<std::size_t>(j));
    }
    resisting_ = moved * inverse;
    turning_ = StateSlopes(model).constraint_rates(state.time, state.q.data(), state.v.data()).first.leftCols(count_);
    slopes_.evaluate_constraints(state.time, state.q.data(), state.v.data());
  }

  // A second time for what rounding leaves of large changes.
  void keep_constraints(Directions<>& rates, const Directions<>& by_parameters) const {
    for (int times = 0; times < 2 && slope_.rows() > 0; ++times) {
      rates.bottomRows(count_) -=
          resisting_ * (slope_ * rates.bottomRows(count_) + turning_ * rates.topRows(count_) + by_parameters);
    }
  }

  Eigen::Index count_;
  Directions<> p_D_q_, p_D_v_;
  ParameterSlopes slopes_;
  Directions<> slope_, resisting_, turning_;  // G, M⁻¹ Gᵀ K⁻¹, ∂(dg/dt)/∂q; empty without constraints
};

}  // namespace pendula
