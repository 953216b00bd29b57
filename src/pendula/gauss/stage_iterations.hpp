#pragma once

#include <limits>
#include <pendula/gauss/iteration_choice.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/system/options.hpp>
#include <utility>

namespace pendula {

/// Stage equations that are solved by exact Newton, by fixed point, or by whichever takes less: what solvers of chains
/// and of any other system share.
template <class Stages>
class StageIterations {
 public:
  using Real = typename Stages::Real;
  using State = typename Stages::State;
  using Place = typename Stages::Place;

  void prepare(double time, double h) {
    stages_.prepare(time, h);
    choice_.begin_step();
    count_ = 0;
  }
  void prepare_again(double time, double h) {
    stages_.prepare_again(time, h);
    count_ = 0;
  }
  void forget() { stages_.forget(); }
  void allow_newton(bool allowed) { choice_.allow_newton(allowed); }
  Iteration iteration() const { return choice_.preferred(); }

  double defect() { return stages_.defect(); }
  double predictor_gain() const { return stages_.predictor_gain(); }
  Tempo tempo() const { return stages_.tempo(); }
  double work() const { return static_cast<double>(stages_.work()); }

  State state(double time) const { return stages_.state(time); }
  Place place() const { return stages_.place(); }
  void keep(Place& place) const { stages_.keep(place); }
  void go_to(const Place& place) {
    stages_.go_to(place);
    choice_.begin_look();
  }
  State glance(const Place& begin, double time, double x) const { return stages_.glance(begin, time, x); }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(stages_, choice_);
  }

 protected:
  /// `cost`: of a Newton iteration, in fixed-point iterations.
  template <class... Given>
  StageIterations(Iteration iteration, double cost, Given&&... stages)
      : stages_(std::forward<Given>(stages)...), choice_(iteration, cost) {}

  bool is_by_newton() const { return choice_.active() == Iteration::newton; }

  /// One iteration. A fixed point that does not contract leaves the step to Newton; `parts` say how far rounding goes.
  template <class Newton>
  Correction correct(Newton& newton, int parts) {
    ++count_;
    choice_.count_iteration();
    if (!is_by_newton()) {
      const double change = stages_.iterate();
      if (count_ == 1) stages_.see_first(change);
      if (!choice_.is_automatic() ||
          !diverges(change, last_.relative, count_, usual_rounding(parts, epsilon), epsilon)) {
        return last_ = {change};
      }
      if (!choice_.newton_is_allowed()) return last_ = {std::numeric_limits<double>::quiet_NaN()};
      stages_.start_cold();
      choice_.give_up_fixed_point();
    }
    last_ = newton.correct(stages_);
    last_.convergence = Convergence::quadratic;
    return last_;
  }

  Stages stages_;
  IterationChoice choice_;
  Correction last_;

 private:
  static constexpr double epsilon = static_cast<double>(std::numeric_limits<Real>::epsilon());

  int count_ = 0;
};

}  // namespace pendula
