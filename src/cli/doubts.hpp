#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/chain/chain.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/simulation.hpp>
#include <pendula/run/subject.hpp>
#include <string>

#include "cli/warnings.hpp"
#include "io/number.hpp"
#include "io/run_record.hpp"
#include "io/scenario.hpp"

namespace pendula::cli {

/// What makes a run that ended well doubtful all the same. Measured on random chains: docs/method.md.

inline std::string smaller_step_advice(const RunOptions& run) {
  if (is_adaptive(run.method)) return "a smaller run.tolerance may help";
  if (run.method == Method::rk4) return "a smaller run.step, or run.method = \"gauss\", may help";
  return run.stages < 4 ? "a smaller run.step or more run.stages may help" : "a smaller run.step may help";
}

/// Damping so strong that a Gauss step does not follow it: Gauss methods are A-stable, but do not damp what they do not
/// resolve. The rate is that of a link alone, λ/l² (1/m_i + 1/m_{i−1}).
template <class Space>
void warn_of_stiffness(const Chain<Space>& chain, const RunOptions& run, Warnings& warnings) {
  if (run.method != Method::gauss) return;
  static constexpr double followed = 5;  // of one step, where e^{-x} is 0.7 %
  for (int i = 0; i < chain.links(); ++i) {
    const double inverse_mass = 1 / chain.masses()[i] + (i == 0 ? 0 : 1 / chain.masses()[i - 1]);
    const double rate = chain.damping()[i] * inverse_mass / (chain.lengths()[i] * chain.lengths()[i]);
    if (rate * run.step <= followed) continue;
    warnings.add("damping stops link " + std::to_string(i + 1) + " within " + io::shortest(1 / rate) +
                 " s, far less than run.step: its velocities may be wrong; run.method = \"radau\" is made for that");
    return;
  }
}

/// The energy of an undamped motion is known, that of a damped one at least never grows.
inline void warn_of_energy(const Subject& subject, const RunOptions& run, const io::EnergyBalance& balance,
                           Warnings& warnings) {
  static constexpr double trusted = 1e-3;
  if (is_explicit(run.method) && subject.loaded()) return;  // nobody adds up the work
  const bool sinks = run.method == Method::radau && subject.damped();
  const double off = sinks ? balance.most : std::max(balance.most, -balance.least);
  if (off <= trusted) return;
  const std::string whole = subject.coordinates().empty() ? "of all that the chain has; " : "of all that moved; ";
  warnings.add("energy is off by " + io::rounded(off, 2) + " " + whole + smaller_step_advice(run));
}

inline void warn_of_defect(const RunOptions& run, double defect, Warnings& warnings) {
  static constexpr double trusted = 0.02;
  if (defect <= trusted || run.stages == 1) return;
  warnings.add("a step missed the velocity by " + io::rounded(defect, 2) + " of the fastest; " +
               smaller_step_advice(run));
}

/// Near a pole φ moves faster than steps follow, even in parts.
inline void warn_of_pole(const Description& description, const Statistics& statistics, Warnings& warnings) {
  if (description.solver != "dense" || statistics.rejected_steps == 0) return;
  warnings.add("the dense solver came near a pole of (theta, phi) and took " +
               std::to_string(statistics.rejected_steps) + " steps in parts; run.solver = \"chain\" knows no pole");
}

/// Whether a second run is worth its time: none that was wrong had followed the motion so closely.
inline bool is_doubtful(const RunOptions& run, const Statistics& statistics) {
  return run.method != Method::gauss || statistics.largest_defect > 2e-5;
}

/// Runs again with longer steps, or a tolerance a hundred times as large: where that ends elsewhere, the steps or the
/// chaos of the motion decide where. Steps of twice the length, where some were taken in parts, would be taken in the
/// same parts again.
template <class Stop>
void warn_of_step(const Subject& subject, const io::RunPlan& plan, const Motion& start, const Motion& end,
                  const Statistics& statistics, Stop stop, Warnings& warnings) {
  static constexpr double trusted = 0.01;
  const bool in_parts = statistics.rejected_steps > 0;
  RunOptions coarser = plan.run;
  coarser.step *= in_parts ? 3 : 2;
  coarser.tolerance *= 100;
  const auto integrator = subject.make_integrator(coarser);
  const double step = is_adaptive(coarser.method) ? std::numeric_limits<double>::infinity() : coarser.step;
  Motion other = start;
  const RunResult result = simulate(
      *integrator, start, {step, plan.duration, std::numeric_limits<std::int64_t>::max()},
      [&](const Motion& motion) { other = motion; }, stop);
  if (result.stopped) return;
  const double off = result.outcome ? subject.distance(end, other) : std::numeric_limits<double>::infinity();
  if (off <= trusted) return;
  const std::string what = is_adaptive(coarser.method) ? "with a hundred times the tolerance"
                           : in_parts                  ? "with three times the step"
                                                       : "with twice the step";
  warnings.add(what + " the motion ends " +
               (std::isfinite(off) ? "elsewhere, by " + io::rounded(off, 2) + " of its size" : "before its time") +
               ": the last state cannot be trusted; " + smaller_step_advice(plan.run));
}

}  // namespace pendula::cli
