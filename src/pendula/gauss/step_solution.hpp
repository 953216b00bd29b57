#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <pendula/gauss/fixed_point_stop.hpp>
#include <pendula/gauss/newton_stop.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/step_controller.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/stop_sign.hpp>

namespace pendula {

struct StepperOptions {
  int max_iterations = 50;
  /// The error of a step, relative to the size of the motion; 0: steps have the size that is asked for.
  double tolerance = 0;
  /// How steps are chosen; if it is not given, symmetrically where energy is conserved.
  std::optional<Steering> steering = {};  // NOLINT(readability-redundant-member-init): left out in designated lists
};

/// Solves the stage equations of one step: iterates until corrections are rounding, and judges whether the solution is
/// the motion. GaussStepper takes steps with it.
template <StageSolver Solver>
class StepSolution {
 protected:
  template <class... SolverOptions>
  StepSolution(const typename Solver::Model& model, int stages, const StepperOptions& options,
               const SolverOptions&... solver_options)
      : solver_(model, stages, solver_options...),
        options_(options),
        traits_(solver_.traits()),
        controller_(
            stages, order_of(traits_.dissipates ? Family::radau : Family::gauss, stages), options.tolerance,
            options.steering.value_or(traits_.loaded || traits_.dissipates ? Steering::greedy : Steering::symmetric)),
        fixed_point_stop_(correction_limits(traits_.parts)),
        newton_stop_(traits_.parts, epsilon()) {}

  static double epsilon() { return static_cast<double>(std::numeric_limits<typename Solver::Real>::epsilon()); }

  double time() const { return time_.value; }
  int singular_part() { return solver_.part_of(Status::singular_mass_matrix); }

  /// Predicts the stages of a step of size h from here, and iterates on them.
  Outcome solve(double h, PredictedFrom from, bool may_use_newton = true) {
    prepare({time(), h, from, may_use_newton});
    newton_stop_.restart();
    fixed_point_stop_.restart(1);
    Correction correction;
    double first = 0;
    for (int iteration = 1; iteration <= options_.max_iterations; ++iteration) {
      correction = solver_.correct();
      ++statistics_.newton_iterations;
      if (stop_()) return failure(Status::interrupted, h, iteration, {});
      if (!std::isfinite(correction.relative)) return failure(Status::not_finite, h, iteration, correction);
      if (iteration == 1) first = correction.relative;
      if (!is_at_roundoff(correction)) continue;
      const Status status = status_of_solution(first);
      if (status != Status::ok) return failure(status, h, iteration, correction);
      return {
          .status = Status::ok, .time = time(), .step = h, .iterations = iteration, .residual = correction.relative};
    }
    return failure(Status::not_converged, h, options_.max_iterations, correction);
  }

  // Where a coordinate is singular, every failure is reported as that.
  Outcome failure(Status status, double h, int iterations, const Correction& correction) {
    ++statistics_.rejected_steps;
    const int singular = singular_part();
    if (singular >= 0) status = Status::singular_mass_matrix;
    const bool is_told = status != Status::singular_mass_matrix && status != Status::wrong_root && correction.part >= 0;
    const int part = is_told ? correction.part : solver_.part_of(status);
    return {.status = status,
            .time = time(),
            .step = h,
            .iterations = iterations,
            .residual = correction.relative,
            .part = part};
  }

  Solver solver_;
  StepperOptions options_;
  SolverTraits traits_;
  StepController<double> controller_;
  Compensated<double> time_{};
  double defect_ = 0;  // of the last solution
  Statistics statistics_;
  StopSign stop_;
  FixedPointStop<double, sequences_of<Solver>()> fixed_point_stop_;
  NewtonStop newton_stop_;

 private:
  // Smaller defects of a step are not computed. Defects are reported, not acted on: to change the step would spoil
  // symplecticity, and long chains are right in modes far slower than their fastest.
  static constexpr double noticed_defect = 1e-6;

  // Not inlined into the loop of iterations: there it would crowd out what every iteration calls.
  [[gnu::noinline]] void prepare(const StepTask& task) { solver_.prepare(task); }

  bool is_at_roundoff(const Correction& correction) {
    const double change = correction.relative;
    if (correction.convergence == Convergence::quadratic) return newton_stop_.reached(change);
    if constexpr (requires { solver_.rounding(); }) {
      if (const double rounding = solver_.rounding(); rounding > 0) fixed_point_stop_.expect(rounding);
    }
    return fixed_point_stop_.judge(change * change, true).done;
  }

  // What iterations leave out is a thousandth of the last bit. With ten times that, energy drifts by 1e-21 a step (8
  // stages).
  static CorrectionLimits correction_limits(int parts) {
    return {.enough = 1e-19 * coarseness(epsilon()),
            .last_bit = epsilon(),
            .usual = usual_rounding(parts, epsilon()),
            .small = most_rounding(parts, epsilon()),
            .certainly = 8};
  }

  // Whether the stages are the solution that tends to the state as the step size goes to zero. With damping, only
  // energy that grows speaks against that.
  Status status_of_solution(double first) {
    const double turn = solver_.turn();
    if (!(turn < largest_turn())) return Status::wrong_root;
    if (first > detail::trusted_prediction || turn > detail::trusted_turn) {
      const double energy = solver_.energy_defect();
      if (!(energy < detail::largest_energy_defect)) return Status::wrong_root;
      if (!(energy > -detail::largest_energy_defect) && !traits_.damped) return Status::wrong_root;
    }
    defect_ = may_have_defect() ? solver_.defect(noticed_defect) : 0;
    return Status::ok;
  }

  // No defect is computed for a step of the controller's choice: its error is known.
  bool may_have_defect() const { return !traits_.dissipates && !controller_.chooses(); }

  // A step of the controller's choice may turn farther, since its error is known.
  double largest_turn() const { return controller_.chooses() ? detail::largest_turn : traits_.largest_turn; }
};

}  // namespace pendula
