#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <pendula/system/options.hpp>

namespace pendula {

/// Whether a fixed point, whose corrections were `last` and `correction` relative to the unknowns, contracts so slowly
/// that Newton costs less; far from round-off, so that rounding is not taken for it, or after many iterations, where it
/// is more than the `rounding` that is usual. `count` iterations were made.
inline bool diverges(double correction, double last, int count, double rounding, double epsilon) {
  if (!std::isfinite(correction)) return true;
  const double root = std::sqrt(epsilon);
  const bool far = correction > 67 * root;                                                   // 1e-6 in double
  const bool slow = correction > 0.5 * last && correction > std::max(rounding, root / 150);  // 1e-10
  return count > 20 ? far || slow : far && count > 3 && correction > 0.7 * last;
}

/// Chooses between the two iterations by what they take: iterations a step, counted while the run goes, times the cost
/// of one. The other one is tried for a step now and then, so that the choice follows the motion. Nothing here depends
/// on a clock: the same run makes the same choices.
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

  /// Begins a step for a state within the last one: no trial is made, and how it is solved does not count.
  void begin_look() {
    active_ = preferred_;
    iterations_ = {};
    gave_up_ = false;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(preferred_, spent_, steps_, wait_, next_wait_);
  }

  /// Whether Newton takes over where a fixed point does not contract; else the step is not solved.
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

  // A trial cannot pay where two iterations of the rival already cost more than a step does now. Fewer than two are not
  // expected: a step that takes one Newton iteration hardly takes more of the fixed point.
  bool may_win(Iteration rival) const { return cost_of(rival, 2) < worthwhile * spent_[index(preferred_)]; }

  // A fixed point that has given up is tried again soon, since it may have been one long step, and then ever more
  // seldom.
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
  std::array<double, 2> spent_{};  // by the last step with each iteration, 0: none yet
  std::array<int, 2> iterations_{};
  bool gave_up_ = false;
  bool newton_is_allowed_ = true;
  std::int64_t steps_ = 0;
  int wait_ = 0, next_wait_ = 1;  // steps until a fixed point that has given up is tried; 0: it is its turn as usual
};

}  // namespace pendula
