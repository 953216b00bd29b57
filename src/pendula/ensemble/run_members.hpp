#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <pendula/ensemble/lane_runs.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/run_report.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

namespace detail {

/// About how fast a chain of one kind swings  [1/s]; none of others.
template <class Space>
std::optional<double> natural_pace_in(const Subject& subject) {
  const auto* const found = dynamic_cast<const ChainSubject<Space>*>(&subject);
  if (found == nullptr) return {};
  const Chain<Space>& chain = found->chain();
  return chain.links() * std::sqrt(0.15 * std::abs(chain.gravity()) / chain.lengths().sum());
}

/// About how fast a chain swings  [1/s]; infinite for what is none.
inline double natural_pace(const Subject& subject) {
  const std::optional<double> planar = natural_pace_in<Planar>(subject);
  return planar ? *planar : natural_pace_in<Spatial>(subject).value_or(std::numeric_limits<double>::infinity());
}

}  // namespace detail

/// The options of a run, or those of an explicit method where lanes come to the same errors sooner by that: a Gauss run
/// by a tolerance of more than a few last digits, in which nothing is looked for step by step, and which is over before
/// the energy, which an explicit method loses step by step, is off by more than the motion. A hundredth of the
/// tolerance stands for what the motion makes of the errors of steps.
inline RunOptions quickest_in_lanes(const RunSetup& setup) {
  RunOptions options = setup.options;
  const bool fits = options.method == Method::gauss && options.step == 0 && options.tolerance >= 1e-9 &&
                    setup.events.empty() && setup.duration * detail::natural_pace(*setup.subject) <= 100;
  if (!fits || !lane_kind(setup)) return options;
  options.method = Method::fehlberg78;
  options.tolerance *= 0.01;
  return options;
}

/// Runs that nobody observes, as `Run` does one: many in lanes where they can go there, the others one by one. A report
/// depends on its setup alone, to the last bit; of a run that was stopped it says that and nothing else. Throws as Run.
inline std::vector<RunReport> run_members(
    std::span<const RunSetup> setups, const std::function<bool()>& stop = [] { return false; }) {
  std::vector<RunReport> reports(setups.size());
  std::map<LaneKind, std::vector<std::size_t>> kinds;
  for (std::size_t k = 0; k < setups.size(); ++k) {
    if (const auto kind = lane_kind(setups[k])) {
      kinds[*kind].push_back(k);
    } else {
      reports[k] = Run(setups[k]).go(stop);
    }
  }
  for (const auto& [kind, numbers] : kinds) {
    std::vector<const RunSetup*> alike;
    alike.reserve(numbers.size());
    for (const std::size_t k : numbers) alike.push_back(&setups[k]);
    std::vector<RunReport> found =
        kind.dimension == Planar::dimension ? LaneRuns<Planar>(alike, stop).go() : LaneRuns<Spatial>(alike, stop).go();
    for (std::size_t k = 0; k < numbers.size(); ++k) reports[numbers[k]] = std::move(found[k]);
  }
  return reports;
}

}  // namespace pendula
