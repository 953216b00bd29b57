#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <functional>
#include <pendula/numeric/general_inverse.hpp>
#include <pendula/numeric/linear_system.hpp>
#include <pendula/system/system_model.hpp>
#include <vector>

namespace pendula {

/// Constraints g(q, t) = 0 of a system at one place, and forces Gᵀ λ, G = ∂g/∂q, by which they hold there:
///   K λ = −(G a + d²g/dt² without accelerations),  K = G M⁻¹ Gᵀ,  a the accelerations without them.
/// Where constraints follow from others, λ is one of many, and Gᵀ λ is the same for all. Of constraints of rates,
/// A(q, t) v + b(q, t) = 0, g is 0, G stands for A, and dg/dt for A v + b.
class ConstraintForces {
 public:
  explicit ConstraintForces(const SystemInfo& info)
      : count_(info.constraints.size()),
        coordinates_(info.coordinates.size()),
        values_(count_),
        slopes_(count_ * coordinates_),
        moved_(slopes_),
        inverse_(count_ * count_),
        rates_(count_),
        second_(count_),
        moving_(coordinates_),
        by_place_(slopes_),
        at_rest_(slopes_),
        is_of_rates_(info.constraint_is_of_rates.begin(), info.constraint_is_of_rates.end()),
        masses_(static_cast<Eigen::Index>(coordinates_)),
        softness_(static_cast<Eigen::Index>(count_)) {}

  std::size_t count() const { return count_; }
  /// How many do not follow from others there.
  std::size_t independent() const { return independent_; }
  bool depend() const { return independent_ < count_; }

  /// Goes to q  (coordinates).
  void look(const SystemAt<1>& here, const double* q) {
    here(&SystemFunctions::constraints, q, values_.data(), slopes_.data());
    here(&SystemFunctions::mass_matrix, q, masses_.matrix.data());  // it is symmetric
    moved_ = slopes_;
    masses_.solve(moved_.data(), static_cast<Eigen::Index>(count_));
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j < count_; ++j) {
        double sum = 0;
        for (std::size_t k = 0; k < coordinates_; ++k) sum += slope(i, k) * moved(j, k);
        softness_.matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = sum;
      }
    }
    independent_ = static_cast<std::size_t>(softness_.find(inverse_.data()));
  }

  /// g, ∂g/∂q, M⁻¹ (∂g/∂q)ᵀ, K⁻¹ there.
  double value(std::size_t i) const { return values_[i]; }
  double slope(std::size_t i, std::size_t k) const { return slopes_[i * coordinates_ + k]; }
  double moved(std::size_t i, std::size_t k) const { return moved_[i * coordinates_ + k]; }
  double inverse(std::size_t i, std::size_t j) const { return inverse_[i * count_ + j]; }

  /// K⁻¹ of the constraints of positions among them, 0 in rows and columns of others, (count x count). Returns how many
  /// of them do not follow from others.
  std::size_t find_inverse_of_positions(double* found) {
    if (std::ranges::none_of(is_of_rates_, std::identity())) {
      std::ranges::copy(inverse_, found);
      return independent_;
    }
    const Eigen::MatrixXd all = softness_.matrix;
    for (std::size_t i = 0; i < count_; ++i) {
      if (!is_of_rates_[i]) continue;
      softness_.matrix.row(static_cast<Eigen::Index>(i)).setZero();
      softness_.matrix.col(static_cast<Eigen::Index>(i)).setZero();
    }
    const auto independent = static_cast<std::size_t>(softness_.find(found));
    softness_.matrix = all;
    return independent;
  }

  /// λ in the state q, v, where look was called.
  void find(const SystemAt<1>& here, const double* q, const double* v, const double* a, double* lambda) {
    here(&SystemFunctions::constraint_rates, q, v, rates_.data(), second_.data());
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < coordinates_; ++k) second_[i] += slope(i, k) * a[k];
    }
    resist(second_, lambda);
  }

  /// Adds to accelerations or rates what λ, or impulses, bring.
  void move(const double* lambda, double* rates) const {
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < coordinates_; ++k) rates[k] += moved(i, k) * lambda[i];
    }
  }

  /// Impulses that stop what of the rates v there breaks constraints.
  void stop(const SystemAt<1>& here, const double* q, const double* v, double* impulses) {
    here(&SystemFunctions::constraint_rates, q, v, rates_.data(), second_.data());
    resist(rates_, impulses);
  }
  /// dg/dt in the state that stop was called with.
  double rate(std::size_t i) const { return rates_[i]; }

  /// Σ_i J_i ∂G_ik/∂q_l at q for impulses J  (coordinates k x coordinates l): dg/dt is linear in rates.
  void find_curvature(const SystemAt<1>& here, const double* q, const double* impulses, double* found) {
    std::fill(moving_.begin(), moving_.end(), 0.0);
    find_rates_by_place(here, q, moving_.data(), at_rest_.data());
    for (std::size_t k = 0; k < coordinates_; ++k) {
      moving_[k] = 1;
      find_rates_by_place(here, q, moving_.data(), by_place_.data());
      moving_[k] = 0;
      for (std::size_t l = 0; l < coordinates_; ++l) {
        double sum = 0;
        for (std::size_t i = 0; i < count_; ++i) {
          const std::size_t at = i * coordinates_ + l;
          sum += impulses[i] * (by_place_[at] - at_rest_[at]);
        }
        found[k * coordinates_ + l] = sum;
      }
    }
  }

  /// The derivative of dg/dt by q, in the state q, v  (count x coordinates).
  void find_rates_by_place(const SystemAt<1>& here, const double* q, const double* v, double* found) const {
    here(&SystemFunctions::constraint_rate_slopes, q, v, found);
  }

 private:
  void resist(const std::vector<double>& changes, double* found) const {
    for (std::size_t i = 0; i < count_; ++i) {
      found[i] = 0;
      for (std::size_t j = 0; j < count_; ++j) found[i] -= inverse(i, j) * changes[j];
    }
  }

  std::size_t count_, coordinates_;
  std::vector<double> values_, slopes_;
  std::vector<double> moved_;    // M⁻¹ Gᵀ, constraint by constraint
  std::vector<double> inverse_;  // of K
  std::vector<double> rates_, second_, moving_;
  std::vector<double> by_place_, at_rest_;  // ∂(dg/dt)/∂q
  std::vector<bool> is_of_rates_;
  LinearSystem masses_;
  GeneralInverse softness_;
  std::size_t independent_ = 0;
};

/// Accelerations of a system in a state; constraints hold.
inline void find_accelerations(const SystemModel& model, double time, const double* q, const double* v, double* found) {
  SystemAt<1> here(model);
  here.set_time(time);
  here(&SystemFunctions::acceleration, q, v, found);
  if (model.info().constraints.empty()) return;
  ConstraintForces forces(model.info());
  std::vector<double> lambda(forces.count());
  forces.look(here, q);
  forces.find(here, q, v, found, lambda.data());
  forces.move(lambda.data(), found);
}

}  // namespace pendula
