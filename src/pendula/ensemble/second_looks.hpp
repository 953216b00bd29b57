#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <pendula/ensemble/lane_runs.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/track.hpp>
#include <pendula/run/trust.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace pendula::detail {

/// A track for a run in lanes, of at most 256 kB, since there are many at once.
inline Track lane_track() {
  return Track(Track::apart / 2, std::size_t{1} << 15).by_dense_output();
}

/// A run in lanes that gets a second look.
struct Judged {
  const RunSetup& setup;
  RunReport& report;
  const Track& track;
  Warning warning = {};  // NOLINT(readability-redundant-member-init): left out in initializers
};

/// Lanes are compiled for four and eight stages. With a tolerance, the other run has the other of these numbers. With
/// constant steps it has the same number: the step sizes differ.
inline RunOptions in_lanes(RunOptions options, const RunOptions& run) {
  if (options.method == Method::gauss) options.stages = is_adaptive(run) ? 12 - run.stages : run.stages;
  return options;
}

/// A warning if another run finds other events, or the same ones at other times.
inline Warning of_events(const RunSetup& setup, const SecondLook& look, const RunReport& report,
                         const RunReport& other) {
  for (std::size_t k = 0; k < setup.events.size(); ++k) {
    const EventTally &one = report.events[k], &another = other.events[k];
    const double off = std::abs(one.first - another.first) * look.trusted;
    const bool is_early = !(off > visible * (one.first - setup.start.time));  // true, too, if it never happened
    if (one.count == another.count && is_early) continue;
    const std::string what = "event " + setup.events[k].name + " happens ";
    if (one.count != another.count) {
      return look.how + ' ' + what + std::to_string(another.count) + " times in place of " + std::to_string(one.count);
    }
    return look.how + ' ' + what + "at " + pendula::rounded(another.first, 4) + " s for the first time, not at " +
           pendula::rounded(one.first, 4) + " s";
  }
  return {};
}

/// A warning by the distance from another run. Tracks of runs in lanes are dense output, whose errors are larger than
/// those of steps: they only show whether the motions have parted on the way. The ends are compared exactly.
inline Warning of_other(const Judged& member, const SecondLook& look, const RunReport& other, const Track& track) {
  static constexpr double elsewhere = 0.5;
  const Separation parted(*member.setup.subject, member.track, track);
  const bool is_elsewhere = parted.largest() > elsewhere;
  Warning warning = of_second_look(member.setup, look, is_elsewhere ? parted : parted.of_ends(), member.report.trust);
  return warning ? warning : of_events(member.setup, look, member.report, other);
}

/// A warning where no other run goes in lanes: the member is run alone, with a second look, and its end is compared.
inline Warning of_run_alone(const Judged& member, const std::function<bool()>& stop) {
  const RunSetup& setup = member.setup;
  const RunReport alone = Run(setup).go(stop);
  member.report.trust = alone.trust;
  const std::size_t beside = event_warnings(setup.events, alone.events).size();
  if (alone.warnings.size() > beside) return alone.warnings[beside];
  const bool is_over = alone.end == RunEnd::complete || alone.end == RunEnd::event;
  const double off = is_over ? setup.subject->distance(member.report.last, alone.last, size_of(member.track))
                             : std::numeric_limits<double>::infinity();
  if (!(off <= trusted_error(setup))) return "alone, not in lanes, it ends elsewhere";
  return of_events(setup, {setup.options, "alone, not in lanes,", 1, 1}, member.report, alone);
}

/// Looks at members again, each by the run that choose(member) returns; if it returns none, the warning does not
/// change.
template <class Choose>
void look_by(std::span<Judged* const> members, Choose choose, const std::function<bool()>& stop) {
  std::vector<Judged*> looked;
  std::vector<SecondLook> looks;
  std::vector<RunSetup> setups;
  std::vector<Track> tracks;
  RunsByKind kinds;
  std::vector<std::size_t> others;  // runs that do not go in lanes
  for (Judged* const member : members) {
    const RunOptions& run = member->report.options;
    std::optional<SecondLook> look = choose(*member);
    if (!look) continue;
    const double share = is_adaptive(run) ? start_share * run.tolerance : 0;
    RunSetup setup = member->setup;
    setup.options = in_lanes(look->options, run);
    setup.start.q *= 1 + std::max(share, std::numeric_limits<double>::epsilon());
    setup.start.v *= 1 + std::max(share, std::numeric_limits<double>::epsilon());
    setup.judged = false;
    const std::optional<LaneKind> kind = lane_kind(setup);
    (kind ? kinds[*kind] : others).push_back(looked.size());
    looked.push_back(member);
    looks.push_back(*std::move(look));
    setups.push_back(std::move(setup));
    tracks.push_back(Track::at_times_of(member->track));
  }
  for (const auto& [kind, numbers] : kinds) {
    const std::vector<const RunSetup*> alike = chosen(setups, numbers);
    std::vector<Track*> followed;
    for (const std::size_t k : numbers) followed.push_back(&tracks[k]);
    const auto reports = run_in_lanes(kind, alike, alike[0]->options, stop, followed);
    for (std::size_t j = 0; j < numbers.size(); ++j) {
      const std::size_t k = numbers[j];
      if (!reports[j]) {
        others.push_back(k);
      } else if (reports[j]->end == RunEnd::stopped) {
        looked[k]->report.end = RunEnd::stopped;
      } else {
        looked[k]->warning = of_other(*looked[k], looks[k], *reports[j], tracks[k]);
      }
    }
  }
  for (const std::size_t k : others) {
    looked[k]->warning = of_run_alone(*looked[k], stop);
    if (stop()) looked[k]->report.end = RunEnd::stopped;
  }
}

/// Looks at members again as Run does: by a coarser run, which takes less time, and if that leaves a warning, by a
/// finer one.
inline void look_again(std::vector<Judged>& members, const std::function<bool()>& stop) {
  std::vector<Judged*> left;
  left.reserve(members.size());
  for (Judged& member : members) left.push_back(&member);
  look_by(
      left,
      [](const Judged& member) {
        const RunReport& run = member.report;
        return std::optional(coarser(run.options, run.statistics, member.setup.duration));
      },
      stop);
  std::erase_if(left, [](const Judged* member) { return !member->warning || member->report.end == RunEnd::stopped; });
  look_by(
      left, [](const Judged& member) { return finer(member.report.options, member.setup.duration); }, stop);
  for (Judged& member : members) {
    if (member.warning) member.report.warnings.push_back(*std::move(member.warning));
  }
}

}  // namespace pendula::detail
