#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/ensemble/lane_kind.hpp>
#include <pendula/ensemble/member_ends.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/event_watch.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/run_record.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/step_view.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/run/track.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

namespace detail {

/// The scale of the energy errors of a member  [J]; `sum`: the largest |T| + |U| along its motion.
inline double energy_scale(const Subject& subject, const Observation& before, const Observation& after, double sum) {
  if (subject.energy_scale()) return compared_with(subject.energy_scale(), before.energy);
  const auto sizes = [](const Observation& seen) { return std::abs(seen.kinetic) + std::abs(seen.potential()); };
  return std::max({sum, sizes(before), sizes(after)});
}

/// Chains of runs of one kind as members for the compiled library, and their ends.
template <class Space>
class PlainChains : public MemberEnds {
 public:
  /// `setups` must outlive it.
  PlainChains(std::span<const RunSetup* const> setups, const LaneKind& /*kind*/)
      : MemberEnds(setups[0]->start.q.size(), setups.size()) {
    for (const RunSetup* setup : setups) {
      const Motion& start = setup->start;
      const Chain<Space>& chain = static_cast<const ChainSubject<Space>&>(*setup->subject).chain();
      const std::vector<PlainChain::Drive>& drives = drives_.emplace_back(plain_drives(chain));
      const double end = start.time + setup->duration;
      members_.push_back({plain(chain, drives), start.time, end, start.q.data(), start.v.data()});
    }
  }

  /// Moves all; false if `watch` stopped it.
  bool move(const RunOptions& options, std::int64_t every, MemberWatch& watch) {
    return library<LaneMovers<Space>>().plain(options)(options, every, members_, all(), watch);
  }
  bool move_with_tangents(const RunOptions& options, MemberWatch& watch) {
    return library<LaneMovers<Space>>().with_tangents(options)(options, 0, members_, all(), watch);
  }

  /// The solver and the iteration of the stage equations.
  Description description() const { return {"chain", "fixed-point", ""}; }

 private:
  std::deque<std::vector<PlainChain::Drive>> drives_;  // members point to them: a deque does not move its elements
  std::vector<PlainMember<PlainChain>> members_;
};

/// The same for systems of one kernel, and for planar chains that move as systems of their kernel.
class PlainSystems : public MemberEnds {
 public:
  /// `setups` must outlive it.
  PlainSystems(std::span<const RunSetup* const> setups, const LaneKind& kind)
      : MemberEnds(setups[0]->start.q.size(), setups.size()), table_(*kind.kernel) {
    for (const RunSetup* setup : setups) {
      const Motion& start = setup->start;
      const double end = start.time + setup->duration;
      members_.push_back({numbers_of(*setup->subject), start.time, end, start.q.data(), start.v.data()});
    }
  }

  bool move(const RunOptions& options, std::int64_t every, MemberWatch& watch) {
    return library<LaneMovers<Models>>().plain(options)(table_, options, every, members_, all(), watch);
  }
  bool move_with_tangents(const RunOptions& options, MemberWatch& watch) {
    return library<LaneMovers<Models>>().with_tangents(options)(table_, options, 0, members_, all(), watch);
  }

  Description description() const { return {"dense", "fixed-point", std::string(table_.info.name)}; }

 private:
  PlainSystem numbers_of(const Subject& subject) {
    if (const auto* const system = dynamic_cast<const SystemSubject*>(&subject)) return system->numbers().plain();
    const Chain<Planar>& chain = static_cast<const ChainSubject<Planar>&>(subject).chain();
    const std::vector<PlainChain::Drive> drives = plain_drives(chain);
    return chains_.emplace_back(plain(chain, drives), Planar::torque_components).plain();
  }

  const SystemTable& table_;
  std::deque<ChainSystem> chains_;  // members point to them: a deque does not move its elements
  std::vector<PlainMember<PlainSystem>> members_;
};

}  // namespace detail

/// Runs of one kind, in lanes. `Members` is PlainChains or PlainSystems.
template <class Members>
class LaneRuns : private MemberWatch {
 public:
  /// `kind` is the lane_kind of all `setups` by `options`; their own options tell how they would be run alone. `tracks`
  /// has a track to be filled for each, or null. Both must outlive it.
  LaneRuns(const LaneKind& kind, std::span<const RunSetup* const> setups, const RunOptions& options,
           const std::function<bool()>& stop, std::span<Track* const> tracks)
      : setups_(setups), options_(options), stop_(stop), tracks_(tracks), members_(setups, kind) {
    watches_.reserve(setups.size());
    for (std::size_t k = 0; k < setups.size(); ++k) {
      const RunSetup& setup = *setups[k];
      watches_.emplace_back(setup.events, detail::dense_output_degree(options));
      if (!setup.events.empty()) watches_.back().start(setup.start);
      wants_looks_ |= !setup.events.empty();
      if (tracks[k] != nullptr) tracks[k]->begin(setup.start);
      most_.push_back(most_steps_of(setup));
      wants_steps_ |= !setup.events.empty() || is_tried(k) || tracks[k] != nullptr;
    }
    steps_.resize(setups.size());
    takes_too_long_.resize(setups.size());
  }

  /// The report of each run; nullopt if lanes could not move it.
  std::vector<std::optional<RunReport>> go() {
    reports_.assign(setups_.size(), {});
    move();
    std::vector<std::optional<RunReport>> found(setups_.size());
    for (std::size_t k = 0; k < setups_.size(); ++k) {
      if (stopped_) {
        reports_[k].end = RunEnd::stopped;
      } else if (!finish(k)) {
        continue;
      } else if (tracks_[k] != nullptr) {
        tracks_[k]->finish(reports_[k].last, true);
      }
      found[k] = std::move(reports_[k]);
    }
    return found;
  }

 private:
  void move() {
    stopped_ = !members_.move(options_, setups_[0]->every, *this);
    for (std::size_t k = 0; k < setups_.size(); ++k) {
      if (reports_[k].end != RunEnd::event) reports_[k].last = members_.motion(k);
    }
  }

  /// Fills the report as Run would; false if the member did not reach its end.
  bool finish(std::size_t k) {
    const RunSetup& setup = *setups_[k];
    const MemberEnd& end = members_.end(k);
    RunReport& report = reports_[k];
    const Subject& subject = *setup.subject;
    const Observation before = subject.observe(setup.start), after = subject.observe(report.last);
    if (end.status != Status::ok || !std::isfinite(before.energy) || !std::isfinite(after.energy)) return false;
    report.energy_error = {before.energy, detail::energy_scale(subject, before, after, end.energy_sum), 0};
    const double last = std::abs(after.energy - before.energy);
    report.energy_error.largest = report.energy_error.of(before.energy + std::max(last, end.energy_error));
    if (is_tried(k) && !is_good(k, report)) return false;
    report.energy_final = after.energy;
    report.options = options_;
    report.rows = 1 + (end.steps + setup.every - 1) / setup.every;
    report.statistics.steps = end.steps;
    report.statistics.rejected_steps = end.rejected_steps;
    if (!is_explicit(options_.method)) report.description = members_.description();
    report.events = watches_[k].tallies();
    report.event_cost = watches_[k].cost();
    report.warnings = event_warnings(setup.events, report.events);
    return true;
  }

  std::int64_t most_steps_of(const RunSetup& setup) const {
    const bool tried = options_.method != setup.options.method && detail::has_to_be_tried(*setup.subject);
    if (!tried) return no_limit;
    return setup.subject->loaded() ? most_unchecked_steps : most_steps;
  }
  bool is_tried(std::size_t k) const { return most_[k] != no_limit; }
  bool is_good(std::size_t k, const RunReport& report) const {
    const RunSetup& setup = *setups_[k];
    return !takes_too_long_[k] && (setup.subject->loaded() || report.energy_error.largest <= setup.options.tolerance);
  }
  // The number of steps is extrapolated from the share of the run that is done.
  bool takes_too_long(std::size_t k, double time) const {
    if (steps_[k] >= most_[k]) return true;
    if (steps_[k] != tried_steps || !is_tried(k)) return false;
    const RunSetup& setup = *setups_[k];
    const double share = (time - setup.start.time) / setup.duration;
    return tried_steps > 2 * share * static_cast<double>(most_[k]);
  }

  // --- After each step ---

  /// The last step of the member in a lane.
  class LaneStep : public StepView {
   public:
    LaneStep(MemberSteps& steps, int lane, Eigen::Index coordinates)
        : steps_(steps), lane_(lane), coordinates_(coordinates) {}

    double time() const override { return steps_.end(lane_); }
    void read_state(Motion& motion) const override {
      prepare(time(), motion);
      steps_.state(lane_, motion.q.data(), motion.v.data());
    }
    void at(double time, Motion& motion) override { at(share(time), time, motion); }
    void at(double share, double time, Motion& motion) override {
      prepare(time, motion);
      steps_.at(lane_, share, motion.q.data(), motion.v.data());
    }
    Outcome at_full_order(double time, Motion& motion) override {
      prepare(time, motion);
      const bool found = steps_.at_full_order(lane_, share(time), motion.q.data(), motion.v.data());
      return {.status = found ? Status::ok : Status::not_converged};
    }

   private:
    double share(double time) const {
      const double begin = steps_.begin(lane_);
      return (time - begin) / (steps_.end(lane_) - begin);
    }
    void prepare(double time, Motion& motion) const {
      motion.time = time;
      motion.q.resize(coordinates_);
      motion.v.resize(coordinates_);
    }

    MemberSteps& steps_;
    int lane_;
    Eigen::Index coordinates_;
  };

  bool wants_steps() const override { return wants_steps_; }
  bool wants_looks() const override { return wants_looks_; }
  bool stops() override { return stop_(); }

  void after_step(MemberSteps& steps) override {
    for (int lane = 0; lane < steps.lanes(); ++lane) {
      if (!steps.took_step(lane)) continue;
      const std::size_t k = steps.member(lane);
      ++steps_[k];
      if (takes_too_long(k, steps.end(lane))) {
        takes_too_long_[k] = true;
        steps.finish(lane);
      }
      look_into(steps, lane);
    }
  }

  void look_into(MemberSteps& steps, int lane) {
    const std::size_t k = steps.member(lane);
    const RunSetup& setup = *setups_[k];
    LaneStep step(steps, lane, setup.start.q.size());
    std::optional<Motion> end;
    if (!setup.events.empty()) {
      for (const Occurrence& happened : watches_[k].after_step(step)) {
        if (!setup.events[happened.event].stop) continue;
        reports_[k].end = RunEnd::event;
        reports_[k].ended_by = happened.event;
        reports_[k].last = happened.motion;
        end = happened.motion;
        steps.finish(lane);
      }
    }
    if (tracks_[k] != nullptr) tracks_[k]->follow(step, end);
  }

  std::span<const RunSetup* const> setups_;
  RunOptions options_;
  const std::function<bool()>& stop_;
  std::span<Track* const> tracks_;
  std::vector<EventWatch> watches_;
  Members members_;
  std::vector<RunReport> reports_;
  // Most steps of a substituted method: few where nothing checks it, more where the energy does. Their number is
  // extrapolated for the first time after tried_steps.
  static constexpr int most_unchecked_steps = 2000, most_steps = 20000, tried_steps = 200;
  static constexpr std::int64_t no_limit = std::numeric_limits<std::int64_t>::max();

  bool wants_steps_ = false, wants_looks_ = false, stopped_ = false;
  std::vector<std::int64_t> steps_, most_;  // that each member has taken, and may take
  std::vector<bool> takes_too_long_;
};

namespace detail {

/// Indices of the runs of each kind.
using RunsByKind = std::map<LaneKind, std::vector<std::size_t>>;

inline std::vector<const RunSetup*> chosen(std::span<const RunSetup> setups, const std::vector<std::size_t>& numbers) {
  std::vector<const RunSetup*> some;
  some.reserve(numbers.size());
  for (const std::size_t k : numbers) some.push_back(&setups[k]);
  return some;
}

/// LaneRuns of one kind.
inline std::vector<std::optional<RunReport>> run_in_lanes(const LaneKind& kind, std::span<const RunSetup* const> alike,
                                                          const RunOptions& options, const std::function<bool()>& stop,
                                                          std::span<Track* const> tracks) {
  if (kind.kernel != nullptr) return LaneRuns<PlainSystems>(kind, alike, options, stop, tracks).go();
  if (kind.dimension == Planar::dimension) {
    return LaneRuns<PlainChains<Planar>>(kind, alike, options, stop, tracks).go();
  }
  return LaneRuns<PlainChains<Spatial>>(kind, alike, options, stop, tracks).go();
}

}  // namespace detail

}  // namespace pendula
