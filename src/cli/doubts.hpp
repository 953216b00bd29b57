#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/chain/invariants.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/simulation.hpp>
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
void warn_of_stiffness(const io::Scenario<Space>& scenario, Warnings& warnings) {
  if (scenario.run.method != Method::gauss) return;
  static constexpr double followed = 5;  // of one step, where e^{-x} is 0.7 %
  const Chain<Space>& chain = scenario.chain;
  for (int i = 0; i < chain.links(); ++i) {
    const double inverse_mass = 1 / chain.masses()[i] + (i == 0 ? 0 : 1 / chain.masses()[i - 1]);
    const double rate = chain.damping()[i] * inverse_mass / (chain.lengths()[i] * chain.lengths()[i]);
    if (rate * scenario.run.step <= followed) continue;
    warnings.add("damping stops link " + std::to_string(i + 1) + " within " + io::shortest(1 / rate) +
                 " s, far less than run.step: its velocities may be wrong; run.method = \"radau\" is made for that");
    return;
  }
}

/// The energy of an undamped motion is known, that of a damped one at least never grows.
template <class Space>
void warn_of_energy(const io::Scenario<Space>& scenario, const io::EnergyBalance& balance, Warnings& warnings) {
  static constexpr double trusted = 1e-3;
  if (is_explicit(scenario.run.method) && scenario.chain.loaded()) return;  // nobody adds up the work
  const bool sinks = scenario.run.method == Method::radau && scenario.chain.damped();
  const double off = sinks ? balance.most : std::max(balance.most, -balance.least);
  if (off <= trusted) return;
  warnings.add("energy is off by " + io::rounded(off, 2) + " of all that the chain has; " +
               smaller_step_advice(scenario.run));
}

template <class Space>
void warn_of_defect(const io::Scenario<Space>& scenario, double defect, Warnings& warnings) {
  static constexpr double trusted = 0.02;
  if (defect <= trusted || scenario.run.stages == 1) return;
  warnings.add("a step missed the velocity by " + io::rounded(defect, 2) + " of the fastest; " +
               smaller_step_advice(scenario.run));
}

/// Near a pole φ moves faster than steps follow, even in parts.
inline void warn_of_pole(const Description& description, const Statistics& statistics, bool spatial,
                         Warnings& warnings) {
  if (description.solver != "dense" || !spatial || statistics.rejected_steps == 0) return;
  warnings.add("the dense solver came near a pole of (theta, phi) and took " +
               std::to_string(statistics.rejected_steps) + " steps in parts; run.solver = \"chain\" knows no pole");
}

/// Whether a second run is worth its time: none that was wrong had followed the motion so closely.
template <class Space>
bool is_doubtful(const io::Scenario<Space>& scenario, const Statistics& statistics) {
  return scenario.run.method != Method::gauss || statistics.largest_defect > 2e-5;
}

/// Distance of two states: of bobs relative to the length of the chain, and of their velocities to the fastest.
template <class Space>
double distance(const Chain<Space>& chain, const State<Space>& a, const State<Space>& b) {
  const auto furthest = [](const auto& x) { return x.colwise().norm().maxCoeff(); };
  const auto v = bob_velocities(chain, a);
  const double position = furthest(bob_positions(chain, a) - bob_positions(chain, b)) / chain.lengths().sum();
  const double natural = std::sqrt(std::abs(chain.gravity()) * chain.lengths().sum());
  const double speed = std::max(furthest(v), 0.1 * natural);
  const double velocity = furthest(v - bob_velocities(chain, b));
  return position + (velocity == 0 ? 0 : velocity / speed);
}

/// Runs again with longer steps, or a tolerance a hundred times as large: where that ends elsewhere, the steps or the
/// chaos of the motion decide where. Steps of twice the length, where some were taken in parts, would be taken in the
/// same parts again.
template <class Space, class Stop>
void warn_of_step(const io::Scenario<Space>& scenario, const State<Space>& end, const Statistics& statistics, Stop stop,
                  Warnings& warnings) {
  static constexpr double trusted = 0.01;
  const bool in_parts = statistics.rejected_steps > 0;
  RunOptions coarser = scenario.run;
  coarser.step *= in_parts ? 3 : 2;
  coarser.tolerance *= 100;
  const auto integrator = make_integrator(scenario.chain, coarser);
  const double step = is_adaptive(coarser.method) ? std::numeric_limits<double>::infinity() : coarser.step;
  State<Space> other = scenario.start;
  const RunResult result = simulate(
      *integrator, scenario.start, {step, scenario.duration, std::numeric_limits<std::int64_t>::max()},
      [&](const State<Space>& state) { other = state; }, stop);
  if (result.stopped) return;
  const double off = result.outcome ? distance(scenario.chain, end, other) : std::numeric_limits<double>::infinity();
  if (off <= trusted) return;
  const std::string what = is_adaptive(coarser.method) ? "with a hundred times the tolerance"
                           : in_parts                  ? "with three times the step"
                                                       : "with twice the step";
  warnings.add(what + " the motion ends " +
               (std::isfinite(off) ? "elsewhere, by " + io::rounded(off, 2) + " of its size" : "before its time") +
               ": the last state cannot be trusted; " + smaller_step_advice(scenario.run));
}

}  // namespace pendula::cli
