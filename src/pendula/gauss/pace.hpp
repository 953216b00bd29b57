#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/system/system_model.hpp>

namespace pendula {

/// How fast a system goes on: R² = κ + (Σ v_k⁸)^(1/4) over the angles, κ the fastest that a coordinate alone would
/// swing with, or begin to, where the motion starts. 1/R is the time in which the motion changes.
template <System S>
class Pace {
  using Vector = typename S::template Vector<double>;
  using Matrix = typename S::template Matrix<double>;

 public:
  void start(const SystemModel<S>& model, double time, const Vector& q, const Vector& v) {
    Vector p, f;
    Matrix p_D_q, p_D_v, f_D_q, f_D_v;
    S::momentum_form_with_jacobians(model.parameters(time), q, v, model.inputs(time), p, f, p_D_q, p_D_v, f_D_q, f_D_v);
    slowest_squared_ = natural_speed_squared_ = 0;
    for (Eigen::Index k = 0; k < q.size(); ++k) {
      const bool is_angle = S::coordinate_is_angle[static_cast<std::size_t>(k)];
      const double swing = std::abs(f_D_q(k, k)), push = is_angle ? std::abs(f[k]) : 0;
      const double squared = std::max(swing, push) / p_D_v(k, k);
      if (std::isfinite(squared)) slowest_squared_ = std::max(slowest_squared_, squared);
    }
    for (Eigen::Index k = 0; k < q.size() && slowest_squared_ > 0; ++k) {
      const double squared = f[k] * f[k] / p_D_v(k, k) / slowest_squared_;
      if (std::isfinite(squared)) natural_speed_squared_ += squared;
    }
    start_from_nothing(v, p_D_v);
  }

  /// κ  [1/s²].
  double slowest_squared() const { return slowest_squared_; }

  /// Σ M_kk v_k² of what forces at the start give in the time 1/√κ: what rates are small against.
  double natural_speed_squared() const { return natural_speed_squared_; }

  /// R, from Σ v_k⁸ over the angles.
  double of(double eighth_powers) const { return std::sqrt(slowest_squared_ + std::pow(eighth_powers, 0.25)); }

  /// The same from rates, and how it grows by their accelerations.
  Tempo at(const Vector& v, const Vector& a) const {
    double sum = 0, growth = 0;  // of Σ v_k⁸, an eighth of it
    for (Eigen::Index k = 0; k < v.size(); ++k) {
      if (!S::coordinate_is_angle[static_cast<std::size_t>(k)]) continue;
      const double squared = v[k] * v[k], sixth = squared * squared * squared;
      sum += sixth * squared;
      growth += sixth * v[k] * a[k];
    }
    const double pace = of(sum);
    return {pace, sum > 0 ? std::pow(sum, -0.75) * growth / (pace * pace) : 0};
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(slowest_squared_, natural_speed_squared_);
  }

 private:
  // Where nothing turns or pushes yet, 1/s is as good as any; where nothing moves, one unit of length a second.
  void start_from_nothing(const Vector& v, const Matrix& mass) {
    if (slowest_squared_ > 0 || at(v, v).pace > 0) return;
    slowest_squared_ = 1;
    if ((v.array() == 0).all()) natural_speed_squared_ = mass.diagonal().sum();
  }

  double slowest_squared_ = 0, natural_speed_squared_ = 0;
};

}  // namespace pendula
