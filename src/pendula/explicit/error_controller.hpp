#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// Step-size control for explicit methods with an error estimate of order `Order`, for every member by itself: the
/// error of a step stays below a tolerance.
template <class L, int Order>
class ErrorController {
 public:
  using Mask = MaskOf<L>;

  explicit ErrorController(double tolerance)
      : tolerance_(tolerance),
        log_tolerance_(std::log(tolerance)),
        first_(0.5 * std::min(1.0, std::exp(log_tolerance_ * exponent))) {}

  /// Starts these members.
  template <class Stepper>
  void start(const Mask& which, Stepper& stepper) {
    const L pace = sqrt(stepper.pace_squared());
    next_ = select(which, L(first_) / select(pace > L(0.0), pace, L(1.0)), next_);
    longest_ = select(which, stepper.longest_step(tolerance_), longest_);
  }

  /// Size of the next step, unless the run ends before.
  template <class Stepper>
  L step(Stepper& /*stepper*/) const {
    return min(next_, longest_);
  }

  /// Which of the tried steps `h` are accepted. Rejected members get a shorter step.
  template <class Stepper>
  Mask accepts(const Mask& which, const L& h, Stepper& stepper) {
    const L log_error = 0.5 * log(max(stepper.error_squared(), L(detail::almost_zero)));
    const Mask good = which & (log_error <= L(log_tolerance_));
    const L factor = exp(min((L(log_tolerance_) - log_error) * L(exponent), L(2.0)));
    grown_ = h * min(L(most_growth), max(L(least), L(cautious) * factor));
    next_ = select(which & !good, grown_, next_);
    return good;
  }

  /// The next step of these members is `factor` times a failed one.
  void shrink(const Mask& which, const L& h, const L& factor) { next_ = select(which, factor * h, next_); }

  /// Call when the steps were taken.
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
  static constexpr double cautious = 0.9, least = 0.2, most_growth = 5;

  double tolerance_, log_tolerance_, first_;
  L next_{1.0}, grown_{1.0}, longest_{1.0};
};

}  // namespace pendula
