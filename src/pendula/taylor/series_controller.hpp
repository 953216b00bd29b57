#pragma once

#include <pendula/numeric/numeric.hpp>
#include <pendula/taylor/series_limits.hpp>

namespace pendula {

/// Chooses the step of one motion, or of every member: the longest that its Taylor series allows, and after a failed
/// step a shorter one. The stepper has longest_step().
template <class L>
class SeriesController {
 public:
  using Mask = MaskOf<L>;

  explicit SeriesController(double /*tolerance*/) {}

  template <class Stepper>
  void start(const Mask& which, Stepper& /*stepper*/) {
    longest_ = select(which, L(detail::unlimited_step), longest_);
  }

  /// Size of the next step, unless the run ends before.
  template <class Stepper>
  L step(Stepper& stepper) const {
    return min(longest_, stepper.longest_step());
  }

  template <class Stepper>
  Mask accepts(const Mask& which, const L& /*h*/, Stepper& /*stepper*/) const {
    return which;
  }

  /// The next step of these members is `factor` times a failed one.
  void shrink(const Mask& which, const L& h, const L& factor) { longest_ = select(which, factor * h, longest_); }

  template <class Stepper>
  void move_on(const Mask& which, const L& /*h*/, Stepper& /*stepper*/) {
    longest_ = select(which, L(detail::unlimited_step), longest_);
  }

  /// Visits the numbers of one motion, as MemberNumbers does.
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(longest_);
  }

 private:
  L longest_{detail::unlimited_step};
};

}  // namespace pendula
