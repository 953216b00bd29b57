#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/gauss/roundoff.hpp>
#include <utility>

namespace pendula {

/// Decides when Newton's iteration has reached round-off, from the sizes of its corrections relative to the unknowns.
/// Like FixedPointStop, it stops where the next correction would be far below round-off, or where corrections no longer
/// follow their own rate of convergence.
class NewtonStop {
 public:
  /// `epsilon` is that of the type of the unknowns.
  NewtonStop(int links, double epsilon) : epsilon_(epsilon), small_(most_rounding(links, epsilon)) {}

  /// A new step begins. Newton's constant C is remembered from step to step.
  void restart() {
    count_ = 0;
    last_ = 0;
    ++steps_;
  }

  /// Takes the size of a correction just applied. Returns whether no more are needed.
  bool reached(double correction) {
    const double before = std::exchange(last_, correction);
    if (++count_ == 1) {
      first_ = best_ = correction;
      return correction == 0 || is_enough(correction);
    }
    if (correction > noise() && before < 1) {
      const double measured = correction / (before * before);
      constant_ = constant_ == 0 ? measured : std::max(measured, constant_ / 2);
    }
    if (correction <= 2 * epsilon_ || is_enough(correction)) return true;
    const bool stalled = has_stalled(correction / before);
    best_ = std::min(best_, correction);
    return stalled;
  }

  /// Visits the numbers that are remembered from step to step.
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(constant_, steps_);
  }

 private:
  // C from an earlier step may be out of date: now and then one more correction measures it again.
  bool is_enough(double correction) const {
    if (constant_ == 0 || (count_ == 1 && steps_ % check_interval == 0)) return false;
    return safety * constant_ * correction * correction <= negligible();
  }

  // Small corrections whose rate is nearer to 1 than to the average so far are rounding.
  bool has_stalled(double rate) const {
    if (last_ > small_ || rate < 0.5) return false;
    const double average = std::pow(best_ / first_, 1.0 / std::max(1, count_ - 2));
    return rate >= (1 + average) / 2;
  }

  double negligible() const { return 1e-20 * coarseness(epsilon_); }
  // Smaller corrections may be rounding alone and say nothing of C.
  double noise() const { return 1e-12 * coarseness(epsilon_); }

  static constexpr double safety = 10;
  static constexpr int check_interval = 32;

  double epsilon_;
  double small_;  // no iteration that converges stops shrinking above this
  double last_ = 0, first_ = 0, best_ = 0;
  double constant_ = 0;
  int count_ = 0, steps_ = 0;
};

}  // namespace pendula
