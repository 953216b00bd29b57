#pragma once

#include <limits>
#include <pendula/gauss/iteration_choice.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/system/options.hpp>
#include <utility>

namespace pendula {

/// What the solvers of chains and of any other system share: they solve stage equations by exact Newton, by fixed
/// point, or by whichever costs less.
template <class Stages>
class StageIterations {
 public:
  using Real = typename Stages::Real;
  using State = typename Stages::State;
  using FullState = typename Stages::FullState;

  void prepare(const StepTask& task) {
    stages_.prepare(task);
    if (task.from != PredictedFrom::same_step) choice_.begin_step();
    choice_.allow_newton(task.may_use_newton);
    count_ = 0;
  }
  Iteration iteration() const { return choice_.preferred(); }
  /// What rounding may make of the last correction of a fixed point, relative, where that may be more than usual.
  double rounding() const {
    if constexpr (requires { stages_.rounding(); }) return stages_.rounding();
    return 0;
  }

  double defect(double noticed) {
    return first_correction_ >= noticed * stages_.predictor_gain() ? stages_.defect() : 0;
  }
  Tempo tempo() const { return stages_.tempo(); }

  State state(double time) const { return stages_.state(time); }
  void keep(FullState& place) const { stages_.keep(place); }
  void go_to(const FullState& place) {
    stages_.go_to(place);
    choice_.begin_look();
  }
  State at(const FullState& begin, double time, double x) const { return stages_.at(begin, time, x); }
  bool bound_excursions(const FullState& begin, double* q, double* v) const {
    return stages_.bound_excursions(begin, q, v);
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(stages_, choice_);
  }

 protected:
  /// newton_cost: the cost of a Newton iteration, in fixed-point iterations.
  template <class... Given>
  StageIterations(Iteration iteration, double newton_cost, Given&&... stages)
      : stages_(std::forward<Given>(stages)...), choice_(iteration, newton_cost) {}

  bool is_by_newton() const { return choice_.active() == Iteration::newton; }

  /// One iteration. A fixed point that does not contract leaves the step to Newton; rounding grows with the number of
  /// parts.
  template <class Newton>
  Correction correct(Newton& newton, int parts) {
    ++count_;
    choice_.count_iteration();
    last_ = iterate(newton, parts);
    if (count_ == 1) first_correction_ = last_.relative;
    return last_;
  }

  Stages stages_;
  IterationChoice choice_;
  Correction last_;

 private:
  static constexpr double epsilon = static_cast<double>(std::numeric_limits<Real>::epsilon());

  template <class Newton>
  Correction iterate(Newton& newton, int parts) {
    if (!is_by_newton()) {
      const double change = stages_.iterate();
      if (count_ == 1) stages_.see_first(change);
      if (!choice_.is_automatic() ||
          !diverges(change, last_.relative, count_, std::max(rounding(), usual_rounding(parts, epsilon)), epsilon)) {
        return {change};
      }
      if (!choice_.newton_is_allowed()) return {std::numeric_limits<double>::quiet_NaN()};
      stages_.start_cold();
      choice_.give_up_fixed_point();
    }
    Correction correction = newton.correct(stages_);
    correction.convergence = Convergence::quadratic;
    return correction;
  }

  int count_ = 0;  // of iterations of the step
  double first_correction_ = 0;
};

}  // namespace pendula
