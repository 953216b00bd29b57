#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <pendula/system/options.hpp>

namespace pendula {

/// Whether a fixed point contracts so slowly that Newton costs less. `last` and `correction` are its last corrections
/// relative to the unknowns, after `count` iterations. Small corrections do not count, since they may be rounding;
/// after many iterations those above `rounding`, the usual one, do.
inline bool diverges(double correction, double last, int count, double rounding, double epsilon) {
  if (!std::isfinite(correction)) return true;
  const double root = std::sqrt(epsilon);
  const bool far = correction > 67 * root;                                                   // 1e-6 in double
  const bool slow = correction > 0.5 * last && correction > std::max(rounding, root / 150);  // 1e-10
  return count > 20 ? far || slow : far && count > 3 && correction > 0.7 * last;
}

/// Chooses between Newton and fixed point by the cost of a step: its iterations, as counted, times the cost of one. The
/// other iteration is tried for a step now and then, so that the choice follows the motion. Nothing here depends on a
/// clock: the same run makes the same choices.
class IterationChoice {
 public:
  IterationChoice(Iteration wanted, double newton_cost)
      : wanted_(wanted),
        preferred_(wanted == Iteration::automatic ? Iteration::fixed_point : wanted),
        active_(preferred_),
        cost_{newton_cost, 1.0} {}

  Iteration active() const { return active_; }
  Iteration preferred() const { return preferred_; }
  bool is_automatic() const { return wanted_ == Iteration::automatic; }

  void begin_step() {
    begin_look();
    if (is_automatic() && is_time_for_trial() && may_win(other(preferred_))) active_ = other(preferred_);
  }

  /// Begins a step that only finds a state within the last one: no trial is made, and its cost does not count.
  void begin_look() {
    active_ = preferred_;
    iterations_ = {};
    gave_up_ = false;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(preferred_, spent_, steps_, wait_, next_wait_);
  }

  /// Sets whether Newton takes over where a fixed point does not contract. If not, the step is not solved.
  void allow_newton(bool allowed) { newton_is_allowed_ = allowed; }
  bool newton_is_allowed() const { return newton_is_allowed_; }

  void count_iteration() { ++iterations_[index(active_)]; }

  /// A fixed point that does not contract leaves the rest of the step to Newton.
  void give_up_fixed_point() {
    active_ = Iteration::newton;
    gave_up_ = true;
  }

  void end_step() {
    if (!is_automatic()) return;
    if (gave_up_) {
      preferred_ = Iteration::newton;
      spent_[index(Iteration::fixed_point)] = forbidden;
      wait_ = next_wait_;
      next_wait_ = std::min(2 * next_wait_, trial_interval);
    } else {
      spent_[index(active_)] = cost_of(active_, iterations_[index(active_)]);
    }
    gave_up_ = false;
    const Iteration rival = other(preferred_);
    if (spent_[index(rival)] > 0 && spent_[index(rival)] < worthwhile * spent_[index(preferred_)]) preferred_ = rival;
    if (preferred_ == Iteration::fixed_point) next_wait_ = 1;
  }

 private:
  static std::size_t index(Iteration iteration) { return iteration == Iteration::newton ? 0 : 1; }
  static Iteration other(Iteration iteration) {
    return iteration == Iteration::newton ? Iteration::fixed_point : Iteration::newton;
  }

  double cost_of(Iteration iteration, int iterations) const {
    return cost_[index(iteration)] * (iterations + (iteration == Iteration::newton ? last_evaluation : 0));
  }

  // A trial cannot pay where two iterations of the rival cost more than a step does now. Fewer are not expected: where
  // Newton needs one iteration, the fixed point needs hardly more.
  bool may_win(Iteration rival) const { return cost_of(rival, 2) < worthwhile * spent_[index(preferred_)]; }

  // A fixed point that has given up is tried again soon, since one long step may have been the cause, and then ever
  // more seldom.
  bool is_time_for_trial() {
    const bool is_turn = ++steps_ % trial_interval == trial_step;
    return wait_ > 0 ? --wait_ == 0 : is_turn;
  }

  static constexpr int trial_interval = 64, trial_step = 8;
  static constexpr double last_evaluation = 0.3;  // of forces after the last Newton iteration, in iterations
  static constexpr double worthwhile = 0.9;       // what a change has to save
  static constexpr double forbidden = 1e300;

  Iteration wanted_, preferred_, active_;
  std::array<double, 2> cost_;
  std::array<double, 2> spent_{};  // cost of the last step with each iteration; 0: none yet
  std::array<int, 2> iterations_{};
  bool gave_up_ = false;
  bool newton_is_allowed_ = true;
  std::int64_t steps_ = 0;
  int wait_ = 0, next_wait_ = 1;  // steps until a fixed point that has given up is tried; 0: trials as usual
};

}  // namespace pendula
