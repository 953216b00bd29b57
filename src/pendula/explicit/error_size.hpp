#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace pendula {

/// The scale of the errors of a step: each coordinate or rate itself, plus 1 rad or 1/s, or the size of the whole
/// motion if that is smaller, so that oscillations of 1e-9 rad are resolved like any other. The state at the end of the
/// step counts, too: forces may begin at zero.
class ErrorSize {
 public:
  /// For a step from x, with derivative `rate` there, that has moved the state by `moved`.
  ErrorSize(const std::vector<double>& x, const std::vector<double>& rate, const std::vector<double>& moved, double h,
            double tolerance)
      : x_(x), half_(x.size() / 2) {
    double q = 0, v = 0, a = 0;
    for (std::size_t i = 0; i < half_; ++i) {
      const std::size_t k = half_ + i;
      q = std::max({q, std::abs(x[i]), std::abs(x[i] + moved[i])});
      v = std::max({v, std::abs(x[k]), std::abs(x[k] + moved[k])});
      a = std::max(a, std::abs(rate[k]));
    }
    const double rounded = rounding * q / (tolerance * h);
    place_ = std::clamp(std::max(q, h * v), nothing, 1.0);
    turn_ = std::clamp(std::max({v, h * a, rounded}), nothing, 1.0);
  }

  double operator[](std::size_t i) const { return (i < half_ ? place_ : turn_) + std::abs(x_[i]); }

  /// Rounding of rates at rest, relative to coordinates over the step size; least size of a motion.
  static constexpr double rounding = 1e-14, nothing = 1e-16;

 private:
  const std::vector<double>& x_;
  std::size_t half_;
  double place_, turn_;
};

}  // namespace pendula
