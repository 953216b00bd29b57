#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <vector>

namespace pendula {

/// The pace R of one motion, or of several members: 1/R is the time in which the motion changes. R² = κ +
/// (Σ v_k⁸)^(1/4), summed over the angles. κ is the largest ω² with which a coordinate alone would swing, or begin to
/// move, where the motion starts.
template <class Num>
class Pace {
 public:
  /// `info` has to outlive it.
  explicit Pace(const SystemInfo& info) : is_angle_(info.is_angle) {}

  /// Starts a motion at q and v  (coordinates).
  void start(const SystemAt<1>& here, const double* q, const double* v) requires(!is_batch<Num>) {
    const std::size_t count = is_angle_.size();
    const Forces first(here, q, v, is_angle_);
    slowest_squared_ = stiffness(here, q, v, first, is_angle_);
    natural_speed_squared_ = slowest_squared_ > 0 ? first.speed_squared() / slowest_squared_ : 0;
    // Where nothing turns or pushes yet, a pace of 1/s is as good as any; where nothing moves, one unit a second.
    if (slowest_squared_ > 0 || at(v, v).pace > 0) return;
    slowest_squared_ = 1;
    if (!std::all_of(v, v + count, [](double rate) { return rate == 0; })) return;
    for (std::size_t k = 0; k < count; ++k) natural_speed_squared_ += first.mass(k);
  }
  /// A member comes, with its own pace.
  void start(int member, const Pace<double>& own) {
    set(slowest_squared_, member, own.slowest_squared());
    set(natural_speed_squared_, member, own.natural_speed_squared());
  }

  /// κ  [1/s²].
  const Num& slowest_squared() const { return slowest_squared_; }

  /// Σ M_kk v_k² of the rates that forces at the start give in the time 1/√κ: the scale by which rates are small.
  const Num& natural_speed_squared() const { return natural_speed_squared_; }

  /// R², from Σ v_k⁸ over the angles.
  Num squared(const Num& eighth_powers) const { return slowest_squared_ + sqrt(sqrt(eighth_powers)); }

  /// R from rates, and d ln R/dt from accelerations  (coordinates, members).
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

  /// Forces and their slopes at a state. With damping the part that is odd in the rates is left out: motion that is
  /// damped at once does not set the pace.
  class Forces {
   public:
    Forces(const SystemAt<1>& here, const double* q, const double* v, std::span<const bool> is_angle)
        : is_angle_(is_angle), f_(is_angle.size()), p_D_v_(f_.size() * f_.size()), f_D_q_(p_D_v_) {
      find(here, q, v);
      if (!here.model().damped()) return;
      const std::vector<double> forces = f_, slopes = f_D_q_;
      std::vector<double> back(f_.size());
      std::transform(v, v + back.size(), back.begin(), std::negate<>());
      find(here, q, back.data());
      const auto mean = [](double one, double other) { return (one + other) / 2; };
      std::ranges::transform(f_, forces, f_.begin(), mean);
      std::ranges::transform(f_D_q_, slopes, f_D_q_.begin(), mean);
    }

    double mass(std::size_t k) const { return p_D_v_[k * f_.size() + k]; }
    double acceleration(std::size_t k) const { return f_[k] / mass(k); }

    /// κ here.
    double stiffness() const {
      double most = 0;
      for (std::size_t k = 0; k < f_.size(); ++k) {
        const double swing = std::abs(f_D_q_[k * f_.size() + k]), push = is_angle_[k] ? std::abs(f_[k]) : 0;
        const double squared = std::max(swing, push) / mass(k);
        if (std::isfinite(squared)) most = std::max(most, squared);
      }
      return most;
    }

    /// Σ M_kk v_k² that forces give in 1 s.
    double speed_squared() const {
      double sum = 0;
      for (std::size_t k = 0; k < f_.size(); ++k) {
        const double squared = f_[k] * acceleration(k);
        if (std::isfinite(squared)) sum += squared;
      }
      return sum;
    }

    /// Σ M_kk v_k² of the present rates, plus the work Σ |f_k q_k| of forces on the way from 0.
    double scale(const double* q, const double* v) const {
      double sum = 0;
      for (std::size_t k = 0; k < f_.size(); ++k) sum += mass(k) * v[k] * v[k] + std::abs(f_[k] * q[k]);
      return sum;
    }

   private:
    void find(const SystemAt<1>& here, const double* q, const double* v) {
      std::vector<double> p(f_.size()), p_D_q(p_D_v_.size()), f_D_v(p_D_v_.size());
      here(&SystemFunctions::momentum_form_with_jacobians, q, v, p.data(), f_.data(), p_D_q.data(), p_D_v_.data(),
           f_D_q_.data(), f_D_v.data());
    }

    std::span<const bool> is_angle_;
    std::vector<double> f_, p_D_v_, f_D_q_;
  };

  /// κ of a motion that starts with `first`. Where forces hardly change with the coordinates, as at the inflection of a
  /// potential, κ at the state after a time t counts, too, but as 1/t² at most. That state is found with constant
  /// forces.
  static double stiffness(const SystemAt<1>& here, const double* q, const double* v, const Forces& first,
                          std::span<const bool> is_angle) {
    constexpr double longest = 0x1p20, shortest = 0x1p-30;  // s
    const double at_start = first.stiffness();
    const double gained = first.speed_squared(), slow = 4 * first.scale(q, v);
    if (gained == 0 || (at_start > 0 && gained / at_start <= slow)) return at_start;
    std::vector<double> there(is_angle.size());
    double most = at_start;
    for (double time = std::min(longest, 1 / std::sqrt(at_start)); time > shortest; time /= 2) {
      for (std::size_t k = 0; k < there.size(); ++k) there[k] = q[k] + time * (v[k] + time / 2 * first.acceleration(k));
      const double met = Forces(here, there.data(), v, is_angle).stiffness();
      if (most == at_start && met > at_start / 2 && met < 2 * at_start) return at_start;  // as with a spring
      most = std::max(most, std::min(met, 1 / (time * time)));
    }
    return most;
  }

  std::span<const bool> is_angle_;
  Num slowest_squared_{is_batch<Num> ? 1.0 : 0.0}, natural_speed_squared_{0.0};
};

}  // namespace pendula
