#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ostream>
#include <span>
#include <sstream>
#include <string>
#include <string_view>

namespace pendula {

/// How a step ended. Everything but `ok` means that the state was left as it was before the step.
enum class Status {
  ok,
  not_converged,         ///< the stage equations were not solved to round-off
  wrong_root,            ///< they were, but not by the motion: energy came from nowhere, or went there
  tolerance_not_met,     ///< an explicit method shrank its step to nothing
  not_finite,            ///< a value became infinite or NaN
  singular_mass_matrix,  ///< a coordinate fails: φ in (θ, φ) where sin θ = 0
  interrupted,           ///< it was asked to stop
};

constexpr std::string_view name_of(Status status) {
  switch (status) {
    case Status::ok:
      return "ok";
    case Status::not_converged:
      return "not converged";
    case Status::wrong_root:
      return "wrong root";
    case Status::tolerance_not_met:
      return "tolerance not met";
    case Status::not_finite:
      return "not finite";
    case Status::singular_mass_matrix:
      return "singular mass matrix";
    case Status::interrupted:
      return "interrupted";
  }
  return "unknown status";
}

inline std::ostream& operator<<(std::ostream& out, Status status) {
  return out << name_of(status);
}

/// What came of a step, with all that is needed to understand a failure.
struct Outcome {
  Status status = Status::ok;
  double time = 0;      ///< time before the step  [s]
  double step = 0;      ///< step size that was tried  [s]
  int iterations = 0;   ///< Newton (or fixed-point) iterations of the last attempt
  double residual = 0;  ///< last correction relative to the size of the unknowns
  int part = -1;        ///< 0-based link of a chain, coordinate of another system, that it points at; −1: none

  explicit operator bool() const { return status == Status::ok; }
};

/// One sentence that says what happened, when, and where. Of a system that is no chain, with the names of its
/// coordinates.
inline std::string message(const Outcome& outcome, std::span<const std::string_view> coordinates = {}) {
  if (outcome) return "ok";
  std::ostringstream out;
  const bool is_chain = coordinates.empty();
  const auto where = [&](const char* before) -> std::string {
    if (outcome.part < 0) return "";
    const auto part = static_cast<std::size_t>(outcome.part);
    return before + (is_chain ? "link " + std::to_string(part + 1) : std::string(coordinates[part]));
  };
  out << "at t = " << outcome.time << " s: ";
  switch (outcome.status) {
    case Status::not_converged:
      out << "the stage equations did not converge" << where(", worst at ") << " (step " << outcome.step << " s, "
          << outcome.iterations << " iterations, last relative correction " << outcome.residual
          << "); a smaller step may help";
      break;
    case Status::wrong_root:
      out << "the stage equations have a solution that is not the motion, its energy does not balance"
          << where(" or it turns too far, farthest in ") << " (step " << outcome.step << " s, " << outcome.iterations
          << " iterations); a smaller step may help";
      break;
    case Status::tolerance_not_met:
      out << "the error of a step stays above the tolerance, or a value infinite" << where(" at ")
          << ", down to steps of " << outcome.step << " s";
      break;
    case Status::not_finite:
      out << "a value became infinite or NaN" << where(" at ") << " (step " << outcome.step << " s, iteration "
          << outcome.iterations << "); a smaller step may help";
      break;
    case Status::singular_mass_matrix:
      if (is_chain) {
        out << "the mass matrix in (theta, phi) is singular" << where(": sin(theta) = 0 at ")
            << ", where phi has no meaning";
      } else {
        out << "the mass matrix is singular" << where(": no inertia is left in ") << ", which has no meaning there";
      }
      break;
    case Status::interrupted:
      out << "interrupted";
      break;
    case Status::ok:
      break;
  }
  return out.str();
}

inline std::ostream& operator<<(std::ostream& out, const Outcome& outcome) {
  return out << message(outcome);
}

/// What a step does not see between its stages, relative to the speed of the motion.
struct Unseen {
  double impulse = 0;  ///< the largest, to anywhere in the step
  double effect = 0;   ///< on the end of the step

  /// Of an impulse, relative to the speed where it is, that is missed: a wall throws back what it takes half of that
  /// from.
  static constexpr double of_wall(double impulse) { return impulse > 0.4 ? impulse : 0; }
};

/// Counts over a run.
struct Statistics {
  std::int64_t steps = 0;                      ///< accepted steps
  std::int64_t rejected_steps = 0;             ///< attempts that were not accepted
  std::int64_t newton_iterations = 0;          ///< Newton or fixed-point iterations, all attempts
  double load_work = 0;                        ///< energy that torque and damping brought  [J]; NaN where nobody counts
  double largest_defect = 0;                   ///< of a step that was accepted: GaussStepper::step
  double smallest_step = 0, largest_step = 0;  ///< of the method's own choice  [s]; 0: there was none
  /// What steps did not see of the field between their stages, of the speed of the motion, in all; the time from which
  /// that shows in rows  [s].
  double unseen = 0, unseen_from = std::numeric_limits<double>::infinity();

  /// A step of the method's own choice was taken.
  void count_chosen(double h) {
    smallest_step = smallest_step == 0 ? h : std::min(smallest_step, h);
    largest_step = std::max(largest_step, h);
  }

  /// The step from `time` does not see so much. It was chosen by a tolerance; 0: it was as asked for.
  void step_over(double time, double effect, double tolerance) {
    constexpr double visible = 5e-4;
    if (effect <= std::max(tolerance, unseen_rounding)) return;
    unseen += std::isnan(effect) ? std::numeric_limits<double>::infinity() : effect;
    const double trusted = tolerance > 0 ? std::min(visible, 1000 * tolerance) : visible;
    if (unseen > trusted) unseen_from = std::min(unseen_from, time);
  }

  /// Whether a step by a tolerance is to be taken shorter for what it does not see; the shortest are left to their
  /// errors.
  bool has_to_see(double impulse, double h, double tolerance) const {
    constexpr double shortest = 1e-6;  // of the longest step
    return !(impulse <= std::max(tolerance, unseen_rounding)) && h > shortest * largest_step;
  }

  static constexpr double unseen_rounding = 1e-13;

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(steps, rejected_steps, newton_iterations, load_work, largest_defect, smallest_step, largest_step, unseen,
            unseen_from);
  }
};

}  // namespace pendula
