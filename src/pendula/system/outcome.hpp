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

/// How a step ended. Any status but `ok` means that the state is unchanged.
enum class Status {
  ok,
  not_converged,         ///< the stage equations were not solved to round-off
  wrong_root,            ///< the stage equations have a solution that is not the motion: its energy does not balance
  tolerance_not_met,     ///< an explicit method reduced its step to the minimum
  not_finite,            ///< a value became infinite or NaN
  singular_mass_matrix,  ///< a coordinate is undefined: φ in (θ, φ) where sin θ = 0
  interrupted,           ///< the caller asked to stop
  stuck_at_switch,       ///< a function of several pieces holds the motion where it switches, or switches without end
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
    case Status::stuck_at_switch:
      return "stuck at switch";
  }
  return "unknown status";
}

inline std::ostream& operator<<(std::ostream& out, Status status) {
  return out << name_of(status);
}

/// The result of a step, with what is needed to understand a failure.
struct Outcome {
  Status status = Status::ok;
  double time = 0;      ///< time before the step  [s]
  double step = 0;      ///< step size that was tried  [s]
  int iterations = 0;   ///< Newton (or fixed-point) iterations of the last attempt
  double residual = 0;  ///< last correction relative to the size of the unknowns
  /// 0-based link of a chain, or coordinate or switching function of another system, that caused the failure; −1: none.
  int part = -1;

  explicit operator bool() const { return status == Status::ok; }
};

/// One sentence: what happened, when, and where. For a system that is not a chain, pass the names of its coordinates,
/// and its switching functions.
inline std::string message(const Outcome& outcome, std::span<const std::string_view> coordinates = {},
                           std::span<const std::string_view> switches = {}) {
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
        out << "the mass matrix is singular" << where(" at ")
            << ": in space phi has no meaning where sin(theta) = 0; in the plane masses or lengths are too far apart";
      } else {
        out << "the mass matrix is singular" << where(": no inertia is left in ") << ", which has no meaning there";
      }
      break;
    case Status::interrupted:
      out << "interrupted";
      break;
    case Status::stuck_at_switch: {
      const auto part = static_cast<std::size_t>(outcome.part);
      out << "the motion is held where " << (part < switches.size() ? switches[part] : "a switching function")
          << " = 0, or switches there without end: both pieces drive it back, as dry friction does at rest, and which "
             "force holds it the model does not say; an event with stop = true ends the run there, a smooth function "
             "such as tanh(v/small) in place of sign(v) goes on";
      break;
    }
    case Status::ok:
      break;
  }
  return out.str();
}

inline std::ostream& operator<<(std::ostream& out, const Outcome& outcome) {
  return out << message(outcome);
}

/// What a step misses of forces between its stages, relative to the speed of the motion.
struct Unseen {
  double impulse = 0;  ///< the largest missed impulse, to anywhere in the step
  double effect = 0;   ///< on the state at the end of the step

  /// The impulse if it may be that of a wall, else 0: one that takes half of the speed there reflects the motion.
  static constexpr double of_wall(double impulse) { return impulse > 0.4 ? impulse : 0; }
};

/// Counts and extremes over a run.
struct Statistics {
  std::int64_t steps = 0;                      ///< accepted steps
  std::int64_t rejected_steps = 0;             ///< attempts that were not accepted
  std::int64_t newton_iterations = 0;          ///< Newton or fixed-point iterations, all attempts
  double load_work = 0;                        ///< work of torques and damping  [J]; NaN where it is not computed
  double largest_defect = 0;                   ///< defect of an accepted step: GaussStepper::step
  double smallest_step = 0, largest_step = 0;  ///< of steps chosen by the method  [s]; 0: none
  /// Effects that steps missed between their stages, summed, relative to the speed of the motion; the time from which
  /// rows show them  [s].
  double unseen = 0, unseen_from = std::numeric_limits<double>::infinity();
  double constraint_error = 0, constraint_rate_error = 0;  ///< the largest after a step, each in its unit

  /// Counts an adaptive step.
  void count_chosen(double h) {
    smallest_step = smallest_step == 0 ? h : std::min(smallest_step, h);
    largest_step = std::max(largest_step, h);
  }

  /// Counts `effect` missed by the accepted step from `time`. `tolerance` is that of the step size, 0 for constant
  /// steps.
  void step_over(double time, double effect, double tolerance) {
    constexpr double visible = 5e-4;
    if (effect <= std::max(tolerance, unseen_rounding)) return;
    unseen += std::isnan(effect) ? std::numeric_limits<double>::infinity() : effect;
    const double trusted = tolerance > 0 ? std::min(visible, 1000 * tolerance) : visible;
    if (unseen > trusted) unseen_from = std::min(unseen_from, time);
  }

  /// Adds what another part of the run counted.
  Statistics& operator+=(const Statistics& other) {
    steps += other.steps;
    rejected_steps += other.rejected_steps;
    newton_iterations += other.newton_iterations;
    load_work += other.load_work;
    largest_defect = std::max(largest_defect, other.largest_defect);
    if (other.smallest_step > 0) {
      smallest_step = smallest_step == 0 ? other.smallest_step : std::min(smallest_step, other.smallest_step);
    }
    largest_step = std::max(largest_step, other.largest_step);
    unseen += other.unseen;
    unseen_from = std::min(unseen_from, other.unseen_from);
    constraint_error = std::max(constraint_error, other.constraint_error);
    constraint_rate_error = std::max(constraint_rate_error, other.constraint_rate_error);
    return *this;
  }

  /// Whether a step chosen by tolerance must be retried shorter because of what it misses. The shortest steps are left
  /// to their error estimate.
  bool has_to_see(double impulse, double h, double tolerance) const {
    constexpr double shortest = 1e-6;  // relative to the longest step
    return !(impulse <= std::max(tolerance, unseen_rounding)) && h > shortest * largest_step;
  }

  static constexpr double unseen_rounding = 1e-13;

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(steps, rejected_steps, newton_iterations, load_work, largest_defect, smallest_step, largest_step, unseen,
            unseen_from, constraint_error, constraint_rate_error);
  }
};

}  // namespace pendula
