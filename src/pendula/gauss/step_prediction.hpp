#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <pendula/gauss/stage_prediction.hpp>
#include <pendula/gauss/step_task.hpp>

namespace pendula {

/// Chooses how many steps of one size the stages of one motion are predicted from. With short steps each stage is best
/// continued from all known steps; with long ones, from the polynomial through the stages of the last step. The first
/// correction of a fixed point tells which is better, and the other way is tried now and then.
class PredictionDepth {
 public:
  /// The number of steps for the next prediction; 0: from the polynomial of the last step. `as_long`: the next step is
  /// as long as the last one. More than `stages` steps are needed, and at most `most` are used.
  int next(bool as_long, int stages, int most) {
    known_ = as_long ? std::min(known_ + 1, most) : 0;
    const bool prefers_many = by_many_ <= by_last_;
    const bool is_trial = known_ == most && ++steps_ % trial_interval == 0;
    is_by_many_ = known_ > stages && (known_ < most || is_trial != prefers_many);
    return is_by_many_ ? known_ : 0;
  }
  bool is_by_many() const { return is_by_many_; }
  /// Number of steps of the same size before the next step, at most `most`.
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

/// Chooses what the stages of each step of one motion are predicted from. It remembers the size of the last step, and
/// how well predictions went.
class StepPrediction {
 public:
  struct Source {
    double ratio;  ///< size of the step over that of the step it is predicted from; 1 where there is none
    StagePrediction<double> kind;
  };

  /// Chooses for a method with this number of stages, from at most `most` steps. Then no step is known until this one
  /// is accepted, because its stages replace those of the last step.
  Source next(const StepTask& task, int stages, int most) {
    const double known_h = last_h_ != 0 ? last_h_ : h_;
    h_ = task.h;
    if (task.from == PredictedFrom::same_step) {
      is_predicted_ = true;
      depth_.forget();
      return {h_ / known_h, {false, true, false, 0, 0}};
    }
    is_predicted_ = task.from == PredictedFrom::last_step && last_h_ != 0 &&
                    std::abs(h_ / last_h_) < detail::farthest_extrapolation;
    const int depth = depth_.next(is_predicted_ && h_ == last_h_, stages, most);
    const double ratio = is_predicted_ ? h_ / last_h_ : 1;
    last_h_ = 0;
    return {ratio,
            {is_predicted_, false, !is_predicted_, static_cast<double>(depth), static_cast<double>(depth_.known())}};
  }

  /// The first correction of a fixed point on the predicted stages, relative to the unknowns.
  void see_first(double correction) { depth_.saw(correction); }

  void accept() {
    last_h_ = h_;
    ++steps_;
  }

  /// Nothing is known of steps before.
  void forget() {
    last_h_ = 0;
    depth_.forget();
  }

  double h() const { return h_; }                ///< size of the step that was predicted last  [s]
  double last_h() const { return last_h_; }      ///< size of the last accepted step; 0: its stages are not there
  std::int64_t steps() const { return steps_; }  ///< accepted

  /// By which factor the error of the prediction exceeds that of the stage polynomial at the start of its own step:
  /// gain_of_polynomial() where the stages were predicted by that polynomial. A prediction from many steps is better,
  /// so that a small first correction does not show a small error: 0 in one such step of several, which has it looked
  /// at.
  template <class FindGain>
  double gain(FindGain gain_of_polynomial) const {
    if (depth_.is_by_many() && steps_ % looked_at == 0) return 0;
    return is_predicted_ ? static_cast<double>(gain_of_polynomial()) : 1;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(last_h_, steps_, depth_);
  }

 private:
  static constexpr std::int64_t looked_at = 8;

  PredictionDepth depth_;
  double h_ = 0, last_h_ = 0;
  std::int64_t steps_ = 0;
  bool is_predicted_ = false;
};

}  // namespace pendula
