#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <vector>

namespace pendula {

/// How fast a system goes on: R² = κ + (Σ v_k⁸)^(1/4) over the angles, κ the fastest that a coordinate alone would
/// swing with, or begin to, where the motion starts. 1/R is the time in which the motion changes. Of one motion, or of
/// several members.
template <class Num>
class Pace {
 public:
  /// `info` has to outlive it.
  explicit Pace(const SystemInfo& info) : is_angle_(info.is_angle) {}

  /// Of a system at q and v  (coordinates).
  void start(const SystemAt<1>& here, const double* q, const double* v) requires(!is_batch<Num>) {
    const std::size_t count = is_angle_.size();
    std::vector<double> p(count), f(count), p_D_q(count * count), p_D_v(p_D_q), f_D_q(p_D_q), f_D_v(p_D_q);
    here(&SystemFunctions::momentum_form_with_jacobians, q, v, p.data(), f.data(), p_D_q.data(), p_D_v.data(),
         f_D_q.data(), f_D_v.data());
    const auto diagonal = [&](const std::vector<double>& matrix, std::size_t k) { return matrix[k * count + k]; };
    slowest_squared_ = natural_speed_squared_ = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double swing = std::abs(diagonal(f_D_q, k)), push = is_angle_[k] ? std::abs(f[k]) : 0;
      const double squared = std::max(swing, push) / diagonal(p_D_v, k);
      if (std::isfinite(squared)) slowest_squared_ = std::max(slowest_squared_, squared);
    }
    for (std::size_t k = 0; k < count && slowest_squared_ > 0; ++k) {
      const double squared = f[k] * f[k] / diagonal(p_D_v, k) / slowest_squared_;
      if (std::isfinite(squared)) natural_speed_squared_ += squared;
    }
    // Where nothing turns or pushes yet, 1/s is as good as any; where nothing moves, one unit of length a second.
    if (slowest_squared_ > 0 || at(v, v).pace > 0) return;
    slowest_squared_ = 1;
    if (!std::all_of(v, v + count, [](double rate) { return rate == 0; })) return;
    for (std::size_t k = 0; k < count; ++k) natural_speed_squared_ += diagonal(p_D_v, k);
  }
  /// A member comes, with the pace that it has.
  void start(int member, const Pace<double>& own) {
    set(slowest_squared_, member, own.slowest_squared());
    set(natural_speed_squared_, member, own.natural_speed_squared());
  }

  /// κ  [1/s²].
  const Num& slowest_squared() const { return slowest_squared_; }

  /// Σ M_kk v_k² of what forces at the start give in the time 1/√κ: what rates are small against.
  const Num& natural_speed_squared() const { return natural_speed_squared_; }

  /// R², from Σ v_k⁸ over the angles.
  Num squared(const Num& eighth_powers) const { return slowest_squared_ + sqrt(sqrt(eighth_powers)); }

  /// R from rates, and how it grows by their accelerations  (coordinates, members).
  TempoOf<Num> at(const double* v, const double* a) const {
    Num sum(0.0), growth(0.0);  // of Σ v_k⁸, an eighth of it
    for (std::size_t k = 0; k < is_angle_.size(); ++k) {
      if (!is_angle_[k]) continue;
      const Num rate = from_row<Num>(v + k * width), acceleration = from_row<Num>(a + k * width);
      const Num squared = rate * rate, sixth = squared * squared * squared;
      sum = fma(sixth, squared, sum);
      growth = fma(sixth * rate, acceleration, growth);
    }
    const Num root = sqrt(sqrt(sum)), squared = slowest_squared_ + root;
    return {sqrt(squared), select(sum > Num(0.0), growth / (root * root * root * squared), Num(0.0))};
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(slowest_squared_, natural_speed_squared_);
  }

 private:
  static constexpr std::size_t width = width_of<Num>;

  std::span<const bool> is_angle_;
  Num slowest_squared_{is_batch<Num> ? 1.0 : 0.0}, natural_speed_squared_{0.0};
};

}  // namespace pendula
