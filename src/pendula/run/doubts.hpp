#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/run_record.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/simulation.hpp>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

namespace detail {

using Doubt = std::optional<std::string>;

inline std::string smaller_step_advice(const RunOptions& run) {
  if (is_adaptive(run)) return "a smaller run.tolerance may help";
  if (run.method == Method::rk4) return "a smaller run.step, or run.method = \"gauss\", may help";
  return run.stages < 4 ? "a smaller run.step or more run.stages may help" : "a smaller run.step may help";
}

/// The energy of an undamped motion is known, that of a damped one at least never grows.
inline Doubt of_energy(const Subject& subject, const RunOptions& run, const EnergyBalance& balance) {
  static constexpr double trusted = 1e-3;
  if (is_explicit(run.method) && subject.loaded()) return {};  // nobody adds up the work
  const bool sinks = run.method == Method::radau && subject.damped();
  const double off = sinks ? balance.most : std::max(balance.most, -balance.least);
  if (off <= trusted) return {};
  const std::string whole = subject.coordinates().empty() ? "of all that the chain has; " : "of all that moved; ";
  return "energy is off by " + pendula::rounded(off, 2) + " " + whole + smaller_step_advice(run);
}

inline Doubt of_defect(const RunOptions& run, double defect) {
  // Steps of the program's choice follow what they resolve as closely as the tolerance wants.
  const double trusted = is_adaptive(run) ? std::max(1e-3, 30 * std::sqrt(run.tolerance)) : 0.02;
  if (defect <= trusted || run.stages == 1) return {};
  const std::string advice =
      is_adaptive(run) ? "run.method = \"radau\" is made for damping that fast" : smaller_step_advice(run);
  return "a step missed the velocity by " + pendula::rounded(defect, 2) + " of the fastest; " + advice;
}

/// Near a pole φ moves faster than steps of one size follow, even in parts.
inline Doubt of_pole(const Subject& subject, const RunOptions& run, const RunReport& report) {
  const std::int64_t rejected = report.statistics.rejected_steps;
  if (is_adaptive(run) || !subject.has_poles() || report.description.solver != "dense" || rejected == 0) return {};
  return "the dense solver came near a pole of (theta, phi) and took " + std::to_string(rejected) +
         " steps in parts; run.solver = \"chain\" knows no pole";
}

/// Of trials before the run.
inline Doubt of_aim(double wanted, const AccuracyAim& aim) {
  static constexpr double close = 10;  // what trials are off by
  if (aim.error <= close * wanted) return {};
  if (std::isfinite(aim.error)) {
    return "an accuracy of " + pendula::rounded(wanted, 2) + " is not reached: by a tolerance of " +
           pendula::rounded(aim.tolerance, 2) + " the motion ends elsewhere by about " +
           pendula::rounded(aim.error, 1) + " of its size";
  }
  return "runs by the smallest tolerances that are of use end elsewhere, by more than 0.01 of the size: the last state "
         "cannot be trusted";
}

/// Whether a second run is worth its time: none that was wrong had followed the motion so closely.
inline bool is_doubtful(const RunOptions& run, const Statistics& statistics) {
  return run.method != Method::gauss || is_adaptive(run) || statistics.largest_defect > 2e-5;
}

/// Runs again with longer steps, or a tolerance a hundred times as large: where that ends elsewhere, the steps or the
/// chaos of the motion decide where. Steps of twice the length, where some were taken in parts, would be taken in the
/// same parts again.
inline Doubt of_step(const RunSetup& setup, const RunReport& report, const std::function<bool()>& stop) {
  static constexpr double trusted = 0.01;
  const bool in_parts = report.statistics.rejected_steps > 0;
  RunOptions coarser = setup.options;
  coarser.step *= in_parts ? 3 : 2;
  coarser.tolerance *= 100;
  const auto integrator = setup.subject->make_integrator(coarser);
  const double step = is_adaptive(coarser) ? std::numeric_limits<double>::infinity() : coarser.step;
  Motion other = setup.start;
  const RunResult result = simulate(
      *integrator, setup.start, {step, setup.duration, std::numeric_limits<std::int64_t>::max()},
      [&](const Motion& motion) { other = motion; }, stop);
  if (result.stopped) {
    return "it was interrupted while it ran again to see how far the last state can be trusted: that is not known";
  }
  const double off =
      result.outcome ? setup.subject->distance(report.last, other) : std::numeric_limits<double>::infinity();
  if (off <= trusted) return {};
  const std::string what = is_adaptive(coarser) ? "with a hundred times the tolerance"
                           : in_parts           ? "with three times the step"
                                                : "with twice the step";
  return what + " the motion ends " +
         (std::isfinite(off) ? "elsewhere, by " + pendula::rounded(off, 2) + " of its size" : "before its time") +
         ": the last state cannot be trusted; " + smaller_step_advice(setup.options);
}

}  // namespace detail

/// What makes a run that ended well doubtful all the same, one sentence each. `stop` ends the search. Measured on
/// random chains: docs/method.md.
inline std::vector<std::string> doubts(const RunSetup& setup, const RunReport& report, const EnergyBalance& balance,
                                       const std::function<bool()>& stop) {
  std::vector<std::string> doubts;
  const auto add = [&](detail::Doubt doubt) {
    if (doubt) doubts.push_back(*std::move(doubt));
  };
  add(detail::of_energy(*setup.subject, setup.options, balance));
  add(detail::of_defect(setup.options, report.statistics.largest_defect));
  add(detail::of_pole(*setup.subject, setup.options, report));
  if (report.aimed && setup.accuracy.error > 0) {
    add(detail::of_aim(setup.accuracy.error, *report.aimed));
  } else if (detail::is_doubtful(setup.options, report.statistics)) {
    add(detail::of_step(setup, report, stop));
  }
  return doubts;
}

}  // namespace pendula
