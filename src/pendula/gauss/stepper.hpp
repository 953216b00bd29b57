#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <pendula/gauss/linearization.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/step_solution.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/member.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/step_rules.hpp>
#include <pendula/system/stop_sign.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// Takes steps of a Gauss or Radau method with any solver of the stage equations: of a given size, or of a size that it
/// chooses by a tolerance. It can go back into the last step, for a state between its ends.
template <StageSolver Solver>
class GaussStepper : private StepSolution<Solver> {
  using Base = StepSolution<Solver>;

 public:
  using Model = typename Solver::Model;
  using State = typename Solver::State;

  /// Throws std::invalid_argument where there is no method of so many stages, or the solver is not made for it.
  template <class... SolverOptions>
  GaussStepper(const Model& model, int stages, StepperOptions options = {}, const SolverOptions&... solver_options)
      : Base(model, stages, options, solver_options...) {
    solver_.keep(start_);  // so that no step allocates
  }

  /// Starts a new run at `state`; statistics begin at zero.
  Outcome start(const State& state) {
    time_.assign(state.time);
    statistics_ = {};
    before_.step = 0;
    forget_linearization();
    const Status status = solver_.start(state);
    if (status == Status::ok && controller_.chooses()) controller_.start(true, solver_.tempo());
    return started(status);
  }

  /// Advances by `h`; where there is a tolerance, by a step of its own choice, at most `h`. Where the stage equations
  /// of a given step cannot be solved, it is taken in halves, quarters …, down to `smallest_part` of it; if that fails,
  /// too, the state is left as it was, and the outcome says why.
  Outcome step(double h) {
    forget_linearization();
    if (controller_.chooses()) return chosen_step(h);
    Outcome outcome = attempt(h);
    if (!outcome) outcome = step_in_parts(h);
    if (outcome) ++statistics_.steps;
    return outcome;
  }

  /// Reverses the motion where it is. If its steps were chosen symmetrically, it takes the same ones back.
  Outcome turn_back() {
    State state = this->state();
    state.v = -state.v;
    const Status status = solver_.start(state);
    controller_.turn_back();
    before_.step = 0;
    return started(status);
  }

  /// Whether the start of each step is remembered from now on, for at and at_full_order.
  void remember_steps(bool wanted) {
    remembers_ = wanted;
    before_.step = 0;
    if (wanted) solver_.keep(before_.place);
  }

  /// The state at `time` within the last step, by the polynomials through its stages: with s stages, positions of order
  /// s + 1, rates of order s. A step that was taken in parts has left no polynomial: then this is at_full_order.
  State at(double time) {
    if (before_.step == 0) return state();
    State there;
    if (before_.in_parts && at_full_order(time, there)) return there;
    return solver_.at(before_.place, time, before_.elapsed(time) / before_.step);
  }

  /// Bounds of how far coordinates and rates get, anywhere in the last step, from where they were when it began.
  /// Whether they are known.
  bool bound_excursions(double* q, double* v) const {
    return before_.step != 0 && !before_.in_parts && solver_.bound_excursions(before_.place, q, v);
  }

  /// The same at the full order of the method: takes a step from where the last one began to `time`. Its stages are
  /// predicted by the polynomials.
  Outcome at_full_order(double time, State& there) {
    double work = 0;
    return at_full_order(time, there, work);
  }

  /// The same, and the energy that loads have brought by then  [J].
  Outcome at_full_order(double time, State& there, double& work) {
    work = statistics_.load_work;
    if (before_.step == 0 || is_rounding(time - this->time())) {
      there = solver_.state(time);
      return {.status = Status::ok, .time = time};
    }
    const Compensated<double> begin = before_.time;
    const bool remembers = std::exchange(remembers_, false);
    looks_ = true;
    read_member();
    solver_.go_to(before_.place);
    time_ = begin;
    statistics_.load_work = before_.work;
    const double h = before_.elapsed(time);
    Outcome outcome;
    if (!is_rounding(h)) {
      if (!before_.in_parts) {
        outcome = attempt(h, PredictedFrom::same_step);
      }
      if (before_.in_parts || !outcome) {
        outcome = attempt(h, PredictedFrom::nothing);
        if (!outcome) outcome = step_in_parts(h);
      }
    }
    if (outcome) there = solver_.state(time);
    work = statistics_.load_work;
    write_member();
    looks_ = false;
    remembers_ = remembers;
    return outcome;
  }

  /// From now on asks `stop` between iterations, where one iteration takes long. A step that ends by it leaves the
  /// state as it was, but not everything else that the next steps depend on.
  void set_stop_sign(StopSign stop) {
    stop_ = traits_.parts > quick_parts ? stop : StopSign{};
    if constexpr (requires { solver_.set_stop_sign(stop_); }) solver_.set_stop_sign(stop_);
  }

  double time() const { return Base::time(); }
  State state() const { return solver_.state(time()); }
  const Statistics& statistics() const { return statistics_; }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, statistics_, Base::fixed_point_stop_, Base::newton_stop_, controller_, solver_, halved_);
  }

  const Solver& solver() const { return solver_; }

  /// From now on every step leaves its derivative behind. That costs as much as one or two Newton iterations a step.
  void linearize() requires LinearizingSolver<Solver> {
    if (!linearization_) linearization_.emplace(solver_.make_tangent());
  }

  /// The derivative of the last step, after a call of linearize(); the identity where there was no step yet, or the
  /// last one failed.
  auto& linearization() requires LinearizingSolver<Solver> { return *linearization_; }

  /// The smallest part of a failing step that is tried.
  static constexpr double smallest_part = 1.0 / 1024;

 private:
  // So many halvings of a step are tried by fixed point; together they cost less than the whole step by Newton. If they
  // do not help, Newton takes the step.
  static constexpr int fixed_point_worth = 3;
  // If steps were halved for that again and again, more than one in `seldom`, Newton takes them at once: it is
  // convergence that limits them, as after motion that was damped fast, not their errors.
  static constexpr int seldom = 4, often = 16;

  // From such a defect on, a given step is tested for what is damped before its first stage.
  static constexpr double visible_defect = 1e-4;

  template <class Method>
  friend Outcome detail::find_step(Method&, double, int);
  template <class Method>
  friend Outcome detail::take_chosen_step(Method&, double);

  // --- A step of the controller's choice ---

  Outcome chosen_step(double most) {
    look_ahead();
    return detail::take_chosen_step(*this, most);
  }

  double wanted() const { return std::min(controller_.step(), longest_); }
  void keep() { read_member(); }
  void restore() {
    write_member();
    look_ahead();
  }

  /// Forces that depend on time are looked at as if nothing cut the step short.
  void look_ahead() { longest_ = solver_.followed(time(), controller_.step(), options_.tolerance); }

  /// One whose error is too large predicts the stages of the next, shorter one.
  Outcome try_step(double h, bool is_first) {
    if (is_first) {
      search_ = {controller_, halved_ > often ? 0 : fixed_point_worth};
      halved_ = std::max(0, halved_ - 1);
    }
    const PredictedFrom from = search_.is_found ? PredictedFrom::same_step : PredictedFrom::last_step;
    Outcome outcome = Base::solve(h, from, search_.shorter == 0);
    search_.is_found = bool(outcome);
    if (outcome) {
      const StepController<double> wide = controller_;  // what is narrow does not shorten the steps elsewhere
      const bool is_good = controller_.accepts(true, solver_.shape().of(h), h);
      const bool sees_all = sees(h);
      if (!sees_all) controller_ = wide;
      if (is_good && sees_all) return outcome;
      ++statistics_.rejected_steps;
      outcome.status = Status::tolerance_not_met;
    } else {
      controller_.shrink(true, h, 0.5);
      halved_ = std::min(halved_ + seldom, 2 * often);
      if (search_.shorter > 0 && --search_.shorter == 0) controller_ = search_.before;
    }
    return outcome;
  }

  Outcome take(const Outcome& found, bool is_cut) {
    Outcome outcome = accept(found.step, found);
    if (!outcome) return outcome;
    ++statistics_.steps;
    if (is_cut) return outcome;
    statistics_.count_chosen(found.step);
    controller_.move_on(true, found.step, [&] { return solver_.tempo(); });
    return outcome;
  }

  /// Whether the stages see what forces do between them. If not, the next step is at most half of this one.
  bool sees(double h) {
    if constexpr (requires { solver_.unseen(); }) {
      unseen_ = solver_.unseen();
      if (!statistics_.has_to_see(unseen_.impulse, h, options_.tolerance)) return true;
      longest_ = h / 2;
      return false;
    }
    return true;
  }

  // --- A step of a given size ---

  /// One step of exactly h; on failure the state is what it was.
  Outcome attempt(double h, PredictedFrom from = PredictedFrom::last_step) {
    const Outcome outcome = Base::solve(h, from);
    return outcome ? accept(h, outcome) : outcome;
  }

  // Saves all that the next steps depend on, and restores it.
  void read_member() {
    MemberNumbers counted(MemberNumbers::Pass::count);
    member(counted);
    member_.resize(counted.count());
    MemberNumbers numbers(MemberNumbers::Pass::read, member_.data());
    member(numbers);
  }
  void write_member() {
    MemberNumbers numbers(MemberNumbers::Pass::write, member_.data());
    member(numbers);
  }

  // Parts are the step over powers of two, so that they add up to it exactly. After one that
  // succeeded, the next is twice as long, where that fits.
  Outcome step_in_parts(double h) {
    const Compensated<double> start = time_;
    const bool remembers = std::exchange(remembers_, false);
    if (remembers) remember(h, true);
    const Outcome outcome = parts_of(h, start);
    remembers_ = remembers;
    return outcome;
  }

  Outcome parts_of(double h, const Compensated<double>& start) {
    const double work = statistics_.load_work;
    solver_.keep(start_);
    double done = 0, part = 0.5;
    while (done < 1) {
      const Outcome outcome = attempt(h * part);
      if (outcome) {
        done += part;
        const bool fits = std::fmod(done, 2 * part) == 0 && part < 0.5;
        if (fits) part *= 2;
      } else if (part > smallest_part && outcome.status != Status::interrupted) {
        part /= 2;
      } else {
        solver_.go_to(start_);
        time_ = start;
        statistics_.load_work = work;
        forget_linearization();
        return outcome;
      }
    }
    time_ = start;
    time_.add(h);
    return {.status = Status::ok, .time = time(), .step = h};
  }

  void forget_linearization() {
    if constexpr (LinearizingSolver<Solver>) {
      if (linearization_ && !looks_) linearization_->clear();
    }
  }

  Outcome accept(double h, Outcome outcome) {
    if (Base::singular_part() >= 0) {
      return Base::failure(Status::singular_mass_matrix, h, outcome.iterations, {outcome.residual, -1});
    }
    statistics_.largest_defect = std::max(statistics_.largest_defect, defect_);
    count_unseen(h);
    if (remembers_) remember(h, false);
    if constexpr (LinearizingSolver<Solver>) {
      if (linearization_ && !looks_) solver_.linearize(linearization_->next());
    }
    statistics_.load_work += solver_.accept();
    if constexpr (requires { solver_.constraint_errors(); }) {
      const auto [place, rate] = solver_.constraint_errors();
      statistics_.constraint_error = std::max(statistics_.constraint_error, place);
      statistics_.constraint_rate_error = std::max(statistics_.constraint_rate_error, rate);
    }
    time_.add(h);
    outcome.time = time();
    return outcome;
  }

  // Steps of its own choice were looked at when they were found.
  void count_unseen(double h) {
    if (looks_) return;
    if (traits_.loaded && defect_ > visible_defect) {
      const double missed = std::exp(solver_.shape().of(h).log_unseen(traits_.stages));
      statistics_.step_over(time(), missed, options_.tolerance);
    }
    if constexpr (requires { solver_.unseen(); }) {
      if (!controller_.chooses()) unseen_ = solver_.unseen();
      statistics_.step_over(time(), controller_.chooses() ? unseen_.impulse : unseen_.effect, options_.tolerance);
    }
  }

  // The last step.
  struct Remembered {
    Compensated<double> time{};  // where it began
    double step = 0;             // its size; 0: there was none
    bool in_parts = false;
    double work = 0;  // that loads had brought before
    typename Solver::FullState place{};

    double elapsed(double at) const { return (at - time.value) - time.compensation; }
  };

  // Whether an interval is no more than the rounding of the time.
  bool is_rounding(double h) const { return std::abs(h) <= 8 * Base::epsilon() * std::abs(time()); }

  void remember(double h, bool in_parts) {
    before_.time = time_;
    before_.step = h;
    before_.in_parts = in_parts;
    before_.work = statistics_.load_work;
    solver_.keep(before_.place);
  }

  Outcome started(Status status) {
    return {.status = status, .time = time(), .part = status == Status::ok ? -1 : Base::singular_part()};
  }

  using Base::controller_, Base::defect_, Base::options_, Base::solver_, Base::statistics_, Base::stop_, Base::time_,
      Base::traits_;

  /// The search for a step: the controller before it, how many more failures of the fixed point it takes until Newton
  /// may solve the step, and whether the last try was solved.
  struct Search {
    StepController<double> before;
    int shorter;
    bool is_found = false;
  };

  Unseen unseen_;
  double longest_ = 0;  // step that forces which depend on time allow
  Search search_{controller_, fixed_point_worth};
  int halved_ = 0;  // `seldom` for each step that was not solved, less one for each since
  bool remembers_ = false, looks_ = false;
  Remembered before_;
  typename Solver::FullState start_;  // of a step that is taken in parts
  std::vector<double>
      member_;  // saved: of the end of the last step during at_full_order, of the start of a chosen step
  std::optional<typename detail::LinearizationOf<Solver>::type> linearization_;
};

}  // namespace pendula
