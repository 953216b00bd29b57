#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace pendula {

/// How many steps of one size the stages of one motion are predicted from. Where steps are short each stage is
/// continued best from all steps that are known; where they are long, from the polynomial through the stages of the
/// last step. The first correction of a fixed point tells which is better, and the other one is tried now and then.
class PredictionDepth {
 public:
  /// The depth for the next step, which is as long as the last one or not; 0: its stages are predicted from the last
  /// step alone. More than `stages` steps are needed, and `most` are used; if `most` <= `stages`, it is always 0.
  int next(bool as_long, int stages, int most) {
    known_ = as_long ? std::min(known_ + 1, most) : 0;
    const bool prefers_many = by_many_ <= by_last_;
    const bool is_trial = known_ == most && ++steps_ % trial_interval == 0;
    is_by_many_ = known_ > stages && (known_ < most || is_trial != prefers_many);
    return is_by_many_ ? known_ : 0;
  }
  bool is_by_many() const { return is_by_many_; }
  /// Steps of its size that it follows, at most `most`.
  int known() const { return known_; }

  /// The first correction of the step, relative to the unknowns.
  void saw(double correction) { (is_by_many_ ? by_many_ : by_last_) = correction; }

  /// The next step follows none.
  void forget() {
    known_ = 0;
    is_by_many_ = false;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(known_, steps_, by_many_, by_last_);
  }

 private:
  static constexpr std::int64_t trial_interval = 32;

  int known_ = 0;  // steps of this size
  bool is_by_many_ = false;
  std::int64_t steps_ = 0;
  double by_many_ = 0, by_last_ = std::numeric_limits<double>::infinity();  // first corrections
};

}  // namespace pendula
