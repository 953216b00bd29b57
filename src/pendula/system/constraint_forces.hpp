#pragma once

#include <cstddef>
#include <pendula/numeric/general_inverse.hpp>
#include <pendula/numeric/linear_system.hpp>
#include <pendula/system/system_model.hpp>
#include <vector>

namespace pendula {

/// Second derivatives of a function of n coordinates from its second rates, of which rate(k, l) is the one where only
/// the coordinates k and l move, at a rate of 1; of 2 where they are the same; n stands for none. What is linear in
/// rates, or does not depend on them, drops out. Calls take(k, l, ∂²/∂q_k ∂q_l) for all pairs.
template <class Rate, class Take>
void take_second_derivatives(std::size_t n, Rate rate, Take take) {
  const auto none = rate(n, n);
  for (std::size_t k = 0; k < n; ++k) {
    const auto of_k = rate(k, n);
    for (std::size_t l = 0; l <= k; ++l) {
      const auto found = decltype(of_k)(0.5) * ((rate(k, l) - of_k) + (none - rate(l, n)));
      take(k, l, found);
      if (l != k) take(l, k, found);
    }
  }
}

/// Constraints g(q, t) = 0 of a system at one place, and forces Gᵀ λ, G = ∂g/∂q, by which they hold there:
///   K λ = −(G a + d²g/dt² without accelerations),  K = G M⁻¹ Gᵀ,  a the accelerations without them.
/// Where constraints follow from others, λ is one of many, and Gᵀ λ is the same for all.
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

  /// Σ_i J_i ∂²g_i/∂q² at q for impulses J  (coordinates x coordinates).
  void find_curvature(const SystemAt<1>& here, const double* q, const double* impulses, double* found) {
    const auto rate = [&](std::size_t k, std::size_t l) {
      for (std::size_t i = 0; i < coordinates_; ++i) moving_[i] = (i == k ? 1.0 : 0.0) + (i == l ? 1.0 : 0.0);
      here(&SystemFunctions::constraint_rates, q, moving_.data(), rates_.data(), second_.data());
      double sum = 0;
      for (std::size_t i = 0; i < count_; ++i) sum += impulses[i] * second_[i];
      return sum;
    };
    take_second_derivatives(coordinates_, rate,
                            [&](std::size_t k, std::size_t l, double second) { found[k * coordinates_ + l] = second; });
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
