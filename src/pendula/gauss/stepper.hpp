#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>

namespace pendula {

struct StepperOptions {
  int max_iterations = 50;
};

/// Takes implicit Gauss–Legendre steps with any solver of the stage equations, and does not know which one it has.
template <StageSolver Solver>
class GaussStepper {
 public:
  using Model = typename Solver::Model;
  using State = typename Solver::State;

  /// Throws std::invalid_argument if there is no such tableau, or the solver is for another number of links.
  template <class... SolverOptions>
  GaussStepper(const Model& model, int stages, StepperOptions options = {}, const SolverOptions&... solver_options)
      : solver_(model, stages, solver_options...), options_(options), at_roundoff_(solver_.parts(), epsilon()) {}

  /// Starts a new run at `state`; statistics begin at zero.
  Outcome start(const State& state) {
    time_.assign(state.time);
    statistics_ = {};
    const Status status = solver_.start(state);
    return {.status = status, .time = time(), .part = status == Status::ok ? -1 : solver_.singular_part()};
  }

  /// Advances by `h`. Where the stage equations cannot be solved, the step is taken in halves, quarters … as far as
  /// `smallest_part`; if that fails too, the state is left as it was and the outcome says why.
  Outcome step(double h) {
    Outcome outcome = attempt(h);
    if (!outcome) outcome = step_in_parts(h);
    if (outcome) ++statistics_.steps;
    return outcome;
  }

  double time() const { return time_.value; }
  State state() const { return solver_.state(time()); }
  const Statistics& statistics() const { return statistics_; }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, statistics_, at_roundoff_, solver_);
  }

  const Solver& solver() const { return solver_; }

  /// A failing step is tried in parts down to this fraction of it.
  static constexpr double smallest_part = 1.0 / 1024;

 private:
  static double epsilon() { return static_cast<double>(std::numeric_limits<typename Solver::Real>::epsilon()); }

  // From where on the defect of a step is looked for. It is told, not acted on: steps of different sizes would cost
  // what symplectic ones are taken for, and long chains move well in modes far slower than their fastest.
  static constexpr double noticed_defect = 1e-6;

  // An iteration that goes farther than this from where it began, relative to the unknowns, or a link that turns
  // farther, may have come to a solution of the stage equations that is not the motion: its energy is looked at.
  static constexpr double trusted_prediction = 0.02, trusted_turn = 0.5;  // rad
  static constexpr double largest_energy_defect = 0.02;

  /// One step of exactly h; on failure the state is what it was.
  Outcome attempt(double h) {
    solver_.prepare(time(), h);
    at_roundoff_.restart();
    Correction correction;
    double first = 0;
    for (int iteration = 1; iteration <= options_.max_iterations; ++iteration) {
      correction = solver_.correct();
      ++statistics_.newton_iterations;
      if (!std::isfinite(correction.relative)) return failure(Status::not_finite, h, iteration, correction);
      if (iteration == 1) first = correction.relative;
      if (!at_roundoff_.reached(correction.relative, solver_.convergence())) continue;
      const Status status = status_of_solution(first);
      if (status != Status::ok) return failure(status, h, iteration, correction);
      return accept(h, iteration, correction);
    }
    return failure(Status::not_converged, h, options_.max_iterations, correction);
  }

  // Whether the stages are the solution that continues from a step of no length. Methods that
  // damp what they do not resolve are asked for no more than that energy does not grow.
  Status status_of_solution(double first) {
    const double turn = solver_.turn();
    if (!solver_.continues() || !(turn < solver_.largest_turn())) return Status::wrong_root;
    if (first > trusted_prediction || turn > trusted_turn) {
      const double energy = solver_.energy_defect();
      if (!(energy < largest_energy_defect)) return Status::wrong_root;
      if (!(energy > -largest_energy_defect) && !solver_.damped()) return Status::wrong_root;
    }
    defect_ = 0;
    if (solver_.dissipates() || first < noticed_defect * solver_.predictor_gain()) return Status::ok;
    defect_ = solver_.defect();
    return Status::ok;
  }

  // Parts are powers of two of the step, so that they add up to it exactly. They grow again where that works.
  Outcome step_in_parts(double h) {
    const Compensated<double> start = time_;
    const double work = statistics_.load_work;
    solver_.save();
    double done = 0, part = 0.5;
    while (done < 1) {
      const Outcome outcome = attempt(h * part);
      if (outcome) {
        done += part;
        const bool fits = std::fmod(done, 2 * part) == 0 && part < 0.5;
        if (fits) part *= 2;
      } else if (part > smallest_part) {
        part /= 2;
      } else {
        solver_.restore();
        time_ = start;
        statistics_.load_work = work;
        return outcome;
      }
    }
    time_ = start;
    time_.add(h);
    return {.status = Status::ok, .time = time(), .step = h};
  }

  Outcome accept(double h, int iterations, const Correction& correction) {
    if (solver_.singular_part() >= 0) return failure(Status::singular_mass_matrix, h, iterations, correction);
    if (solver_.loaded()) statistics_.load_work += solver_.work();
    statistics_.largest_defect = std::max(statistics_.largest_defect, defect_);
    solver_.accept();
    time_.add(h);
    return {.status = Status::ok, .time = time(), .step = h, .iterations = iterations, .residual = correction.relative};
  }

  // A failure where coordinates are singular is theirs, whatever shape it took.
  Outcome failure(Status status, double h, int iterations, const Correction& correction) {
    ++statistics_.rejected_steps;
    const int singular = solver_.singular_part();
    if (singular >= 0) status = Status::singular_mass_matrix;
    const int part = singular >= 0                  ? singular
                     : status == Status::wrong_root ? solver_.turning_part()
                     : correction.part >= 0         ? correction.part
                                                    : solver_.worst_part();
    return {.status = status,
            .time = time(),
            .step = h,
            .iterations = iterations,
            .residual = correction.relative,
            .part = part};
  }

  Solver solver_;
  StepperOptions options_;
  RoundoffStop at_roundoff_;
  Compensated<double> time_{};
  double defect_ = 0;  // of the last solution
  Statistics statistics_;
};

}  // namespace pendula
