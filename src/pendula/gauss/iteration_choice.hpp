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

/// What costs of steps are compared by. Steps that a fixed point does not solve may be halved until it does: then costs
/// of a second decide. With constraints, an iteration by Newton costs up to 45 by fixed point.
enum class CostOf : std::uint8_t { step, time };

/// Chooses between Newton and fixed point by the cost of a step: its iterations, as counted, times the cost of one. The
/// other iteration is tried for a step now and then, so that the choice follows the motion. Nothing here depends on a
/// clock: the same run makes the same choices.
class IterationChoice {
 public:
  /// newton_cost: the cost of a Newton iteration, in fixed-point iterations.
  IterationChoice(Iteration wanted, double newton_cost, CostOf compared = CostOf::step)
      : wanted_(wanted),
        compared_(compared),
        preferred_(wanted == Iteration::automatic ? Iteration::fixed_point : wanted),
        active_(preferred_),
        cost_{newton_cost, 1.0} {}

  Iteration active() const { return active_; }
  Iteration preferred() const { return preferred_; }
  bool is_automatic() const { return wanted_ == Iteration::automatic; }

  /// A step of h is tried. Where a fixed point does not contract, Newton takes over if that is allowed; otherwise the
  /// step is not solved.
  void try_step(double h, bool newton_is_allowed) {
    if (compared_ == CostOf::time) h_ = std::abs(h);
    newton_is_allowed_ = newton_is_allowed;
  }

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
    numbers(preferred_, spent_, steps_, wait_, next_wait_, solved_);
  }

  /// Whether Newton may cost less than shorter steps by fixed point.
  bool newton_may_pay() const {
    const double newton = spent_[index(Iteration::newton)], fixed_point = spent_[index(Iteration::fixed_point)];
    return compared_ == CostOf::step || newton == 0 || fixed_point == 0 || newton < fixed_point;
  }
  bool newton_is_allowed() const { return newton_is_allowed_; }

  void count_iteration() { ++iterations_[index(active_)]; }

  /// A fixed point that does not contract leaves the rest of the step to Newton.
  void give_up_fixed_point() {
    active_ = Iteration::newton;
    gave_up_ = true;
  }

  void end_step() {
    if (!is_automatic()) return;
    if (gave_up_ && shorter_steps_pay()) {
      spent_[index(Iteration::fixed_point)] *= doubt;
    } else if (gave_up_) {
      preferred_ = Iteration::newton;
      spent_[index(Iteration::fixed_point)] = forbidden;
      wait_ = next_wait_;
      next_wait_ = std::min(2 * next_wait_, trial_interval);
    } else {
      spent_[index(active_)] = cost_of(active_, iterations_[index(active_)]);
      if (active_ == Iteration::fixed_point) solved_ = h_;
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
    return cost_[index(iteration)] * (iterations + (iteration == Iteration::newton ? last_evaluation : 0)) / h_;
  }

  // Of a step that Newton has taken over: whether a fixed point that solved shorter ones takes less.
  bool shorter_steps_pay() {
    if (compared_ == CostOf::step) return false;
    double& newton = spent_[index(Iteration::newton)];
    newton = cost_of(Iteration::newton, iterations_[index(Iteration::newton)]);
    const double fixed_point = spent_[index(Iteration::fixed_point)];
    return solved_ < shorter * h_ && fixed_point > 0 && fixed_point < worthwhile * newton;
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
  static constexpr double shorter = 0.9;  // than a step, of steps that are chosen
  static constexpr double doubt = 1.5;    // by how much more a fixed point is thought to cost where it gave up

  Iteration wanted_;
  CostOf compared_;
  Iteration preferred_, active_;
  std::array<double, 2> cost_;
  double h_ = 1, solved_ = 0;  // of this step, and of the last that a fixed point solved; 1 where costs are of steps
  std::array<double, 2> spent_{};  // cost of the last step with each iteration; 0: none yet
  std::array<int, 2> iterations_{};
  bool gave_up_ = false;
  bool newton_is_allowed_ = true;
  std::int64_t steps_ = 0;
  int wait_ = 0, next_wait_ = 1;  // steps until a fixed point that has given up is tried; 0: trials as usual
};

}  // namespace pendula
