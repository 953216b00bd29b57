#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/accuracy.hpp>
#include <pendula/run/run_record.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/track.hpp>
#include <string>

namespace pendula {

namespace detail {

using Warning = std::optional<std::string>;

inline std::string smaller_step_advice(const RunOptions& run) {
  if (is_adaptive(run)) return "a smaller run.tolerance may help";
  if (run.method == Method::rk4) return "a smaller run.step, or run.method = \"gauss\", may help";
  return run.stages < 4 ? "a smaller run.step or more run.stages may help" : "a smaller run.step may help";
}

/// The energy of an undamped motion is known; that of a damped one never grows.
inline Warning of_energy(const Subject& subject, const RunOptions& run, const EnergyBalance& balance) {
  static constexpr double trusted = 1e-3;
  if (!subject.balances(run.method)) return {};
  const bool sinks = run.method == Method::radau && subject.damped();
  const double off = sinks ? balance.most : std::max(balance.most, -balance.least);
  if (off <= trusted) return {};
  const std::string whole = subject.coordinates().empty() ? "of all that the chain has; " : "of all that moved; ";
  return "energy is off by " + pendula::rounded(off, 2) + " " + whole + smaller_step_advice(run);
}

/// Near a pole φ changes faster than steps of constant size follow, even when they are divided.
inline Warning of_pole(const Subject& subject, const RunOptions& run, const RunReport& report) {
  const std::int64_t rejected = report.statistics.rejected_steps;
  if (is_adaptive(run) || !subject.has_poles() || report.description.solver != "dense" || rejected == 0) return {};
  return "the dense solver came near a pole of (theta, phi) and took " + std::to_string(rejected) +
         " steps in parts; run.solver = \"chain\" knows no pole";
}

/// An error that anybody sees, relative to the size of the motion.
inline constexpr double visible = 1e-3;

/// Names the rows after `until`.
inline std::string rows_after(double until, double start) {
  return until > start ? "rows after t = " + pendula::rounded(until, 4) + " s" : "all rows";
}
inline std::string untrusted_after(double until, double start) {
  return until > start ? rows_after(until, start) + " cannot be trusted" : "no row can be trusted";
}

/// Whether the defect of a constant step is larger than that of steps whose size was chosen to resolve the motion.
inline bool misses(const RunOptions& run, double defect) {
  constexpr double resolved = 0.02;
  return run.stages != 1 && defect > resolved;
}

/// `missed` is when the first such step began.
inline Warning of_defect(const RunSetup& setup, double defect, std::optional<double> missed, Trust& trust) {
  const RunOptions& run = setup.options;
  if (!missed) return {};
  trust.until = std::min(trust.until, *missed);
  return "a step missed the velocity by " + pendula::rounded(defect, 2) +
         " of the fastest: " + rows_after(*missed, setup.start.time) + " may be wrong; " + smaller_step_advice(run);
}

/// Steps missed something narrow in the forces, and rows show the effect from some time on. With constant steps, they
/// may show a part of it one step earlier: that step may have met the beginning.
inline Warning of_unseen(const RunSetup& setup, const Statistics& statistics, Trust& trust) {
  if (std::isinf(statistics.unseen_from)) return {};
  const double before = is_adaptive(setup.options) ? 0 : setup.options.step;
  const double from = std::max(setup.start.time, statistics.unseen_from - before);
  trust.until = std::min(trust.until, from);
  trust.expected_error = std::numeric_limits<double>::quiet_NaN();
  return "steps went past something narrow in the forces, " + pendula::rounded(statistics.unseen, 1) +
         " of the speed of the motion in all: " + untrusted_after(from, setup.start.time) + "; " +
         smaller_step_advice(setup.options);
}

/// A start from which the equations have more than one solution.
inline Warning of_fork(const RunSetup& setup, Trust& trust) {
  const std::optional<std::size_t> at = setup.subject->fork(setup.start);
  if (!at) return {};
  trust.until = setup.start.time;
  trust.expected_error = std::numeric_limits<double>::quiet_NaN();
  return "the run starts where " + std::string(setup.subject->switches()[*at]) +
         " = 0, and is driven away on both sides: it goes one way of several, " +
         untrusted_after(setup.start.time, setup.start.time);
}

/// Reports what the trials before the run found. `parted` is the distance of the run from the finest trial, if
/// compared.
inline Warning of_aim(const RunSetup& setup, const std::optional<Separation>& parted, const AccuracyAim& aim,
                      Trust& trust) {
  const double wanted = setup.accuracy.error, trusted = close_to_wanted * wanted, start = setup.start.time;
  const double error = std::max({aim.error, parted ? parted->largest() : 0, aim.disputed});
  if (std::isfinite(aim.error) && error <= together) trust.expected_error = error;
  if (error <= trusted) return {};
  trust.until = std::min(aim.trusted_until, aim.disputed_from);
  if (parted) trust.until = std::min(trust.until, parted->within(trusted, start));
  if (aim.disputed > 0) {
    return "steps of another kind find another motion: " + rows_after(trust.until, start) +
           " may be off by up to about " + pendula::rounded(error, 1) + " of the size of the motion";
  }
  const std::string of_wanted = "an accuracy of " + pendula::rounded(wanted, 2) + " is not reached: ";
  if (std::isfinite(trust.expected_error)) {
    return of_wanted + rows_after(trust.until, start) + " are off by up to about " + pendula::rounded(error, 1) +
           " of the size of the motion";
  }
  const double seen = parted ? parted->within(visible, start) : aim.trusted_until;
  const std::string of_those = of_wanted + "even runs by the smallest useful tolerances part; ";
  // The trials diverge from one another, but this run does not diverge from the finest of them.
  if (std::isinf(seen)) return of_those + rows_after(trust.until, start) + " may be less accurate";
  const std::string untrusted = untrusted_after(std::max(seen, trust.until), start);
  return seen > trust.until ? of_those + rows_after(trust.until, start) + " are less accurate, " + untrusted
                            : of_those + untrusted;
}

/// Options of another run to compare a run with.
struct SecondLook {
  RunOptions options;
  std::string how;     ///< for messages: "with twice the step"
  double factor = 1;   ///< error of the run, relative to its distance from the other one, estimated
  double trusted = 1;  ///< upper bound of that factor, since errors scatter
};

/// A comparison run that errs less, for when the coarser one disagrees, which may be the fault of the coarser one
/// alone. Nothing if no run errs less.
inline std::optional<SecondLook> finer(const RunOptions& run, double duration) {
  SecondLook look{run, "with a hundredth of the tolerance", 1, 1.5};
  if (is_adaptive(run)) {
    look.options.tolerance /= 100;
    if (look.options.tolerance < smallest_tolerance_of(run.method)) return {};
    if (run.method == Method::gauss) look.options.stages += run.stages < 8 ? 1 : -1;
    return look;
  }
  constexpr double shorter = 0.8;
  look.options.step = shorter * std::min(run.step, duration);
  look.how = "with four fifths of the step";
  look.factor = 1 / (1 - std::pow(shorter, run.method == Method::rk4 ? 4 : order_of(run)));
  look.trusted = 1.5 * look.factor;
  return look;
}

/// A comparison run that errs more and takes less time: with a hundred times the tolerance, or longer steps. If some
/// steps were divided, doubled steps would be divided into the same parts, so the step is tripled. One stage less is
/// used with a tolerance because steps as long as the method allows would be the same with both tolerances, and what is
/// not damped would end with the same sign. One step that is the whole run cannot be longer: then it is the finer run.
inline SecondLook coarser(const RunOptions& run, const Statistics& statistics, double duration) {
  SecondLook look{run, "with a hundred times the tolerance", 0.2, 0.2};
  if (is_adaptive(run)) {
    look.options.tolerance *= 100;
    if (run.method == Method::gauss && run.stages > 2) --look.options.stages;
    return look;
  }
  if (run.step >= duration) return *finer(run, duration);
  const bool in_parts = statistics.rejected_steps > 0;
  const double longer = in_parts ? 3 : 2;
  look.options.step *= longer;
  // The fixed point alone would divide the longer steps, perhaps into those of the run.
  if (run.iteration == Iteration::fixed_point) look.options.iteration = Iteration::automatic;
  look.how = in_parts ? "with three times the step" : "with twice the step";
  const double less = std::pow(longer, run.method == Method::rk4 ? 4 : order_of(run)) - 1;
  look.factor = 1 / std::min(5.0, less);
  look.trusted = 1 / std::min(2.5, less / 2);
  return look;
}

/// A comparison run with another number of stages, for constant steps that end where functions switch from piece to
/// piece. From one such place to the next there may be a single step, which is the same for every step size.
inline SecondLook by_other_stages(const RunOptions& run) {
  SecondLook look{run, "with other stages", 1, 1.5};
  look.options.stages += run.stages < (run.method == Method::radau ? 3 : 8) ? 1 : -1;
  return look;
}

/// The largest error that is not reported: about the one asked for. With a tolerance of the motion, the usual error of
/// a motion without chaos.
inline double trusted_error(const RunSetup& setup) {
  if (setup.accuracy.error > 0) return close_to_wanted * setup.accuracy.error;
  if (setup.motion_tolerance > 0) return std::min(visible, 1000 * setup.motion_tolerance);
  const bool is_of_motion = is_adaptive(setup.options) && !is_explicit(setup.options.method);
  return is_of_motion ? std::min(visible, 1000 * setup.options.tolerance) : visible;
}

/// Where the two runs diverge depends on the steps or on the chaos of the motion.
inline Warning of_second_look(const RunSetup& setup, const SecondLook& look, const Separation& parted, Trust& trust) {
  const double start = setup.start.time, trusted = trusted_error(setup), error = parted.largest() * look.factor;
  trust.expected_error = error <= visible ? error : std::numeric_limits<double>::quiet_NaN();
  trust.until = parted.within(trusted / look.trusted, start);
  if (std::isinf(trust.until)) return {};
  const std::string rows = rows_after(trust.until, start);
  if (parted.largest() * look.trusted <= visible) {
    return rows + " may be off by more than " + pendula::rounded(trusted, 2) + ", up to about " +
           pendula::rounded(error, 1) + " of the size of the motion, which amplifies the errors of its steps";
  }
  const double seen = parted.within(visible / look.trusted, start);
  return look.how + " the motion goes elsewhere: " +
         (seen > trust.until ? rows + " may be off by more than " + pendula::rounded(trusted, 2) + ", " : "") +
         untrusted_after(seen, start) + "; " + smaller_step_advice(setup.options);
}

}  // namespace detail
}  // namespace pendula
