#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// Chooses the steps of every member by the error of its last one, as explicit methods do that have an estimate of it
/// of `Order`: a step is to err by no more than a tolerance.
template <class L, int Order>
class ErrorController {
 public:
  using Mask = MaskOf<L>;

  explicit ErrorController(double tolerance)
      : tolerance_(tolerance),
        log_tolerance_(std::log(tolerance)),
        first_(0.5 * std::min(1.0, std::exp(log_tolerance_ * exponent))) {}

  /// Members that start.
  template <class Stepper>
  void start(const Mask& which, Stepper& stepper) {
    const L pace = sqrt(stepper.pace_squared());
    next_ = select(which, L(first_) / select(pace > L(0.0), pace, L(1.0)), next_);
    longest_ = select(which, stepper.longest_step(tolerance_), longest_);
  }

  /// Of the next step, unless the run ends before.
  template <class Stepper>
  L step(Stepper& /*stepper*/) const {
    return min(next_, longest_);
  }

  /// Which of the steps `h` that were tried are good enough; those that are not get a shorter one.
  template <class Stepper>
  Mask accepts(const Mask& which, const L& h, Stepper& stepper) {
    const L log_error = 0.5 * log(max(stepper.error_squared(), L(tiny)));
    const Mask good = which & (log_error <= L(log_tolerance_));
    const L factor = exp(min((L(log_tolerance_) - log_error) * L(exponent), L(2.0)));
    grown_ = h * min(L(most_growth), max(L(least), L(cautious) * factor));
    next_ = select(which & !good, grown_, next_);
    return good;
  }

  /// The next step of these members is to be `factor` of one that failed.
  void shrink(const Mask& which, const L& h, const L& factor) { next_ = select(which, factor * h, next_); }

  /// Steps h were taken.
  template <class Stepper>
  void move_on(const Mask& which, const L& /*h*/, Stepper& /*stepper*/) {
    next_ = select(which, grown_, next_);
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(next_, grown_, longest_);
  }

 private:
  static constexpr double exponent = 1.0 / (Order + 1);
  static constexpr double cautious = 0.9, least = 0.2, most_growth = 5, tiny = 1e-300;

  double tolerance_, log_tolerance_, first_;
  L next_{1.0}, grown_{1.0}, longest_{1.0};
};

}  // namespace pendula
