#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/event_watch.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/run_record.hpp>
#include <pendula/run/run_report.hpp>
#include <span>
#include <tuple>
#include <vector>

namespace pendula {

/// Runs that members in lanes can take together: all that their steps have in common.
struct LaneKind {
  int dimension = 0, links = 0, stages = 0;
  Method method = Method::gauss;
  double step = 0, tolerance = 0;
  std::int64_t every = 0;

  auto tied() const { return std::tie(dimension, links, stages, method, step, tolerance, every); }
  bool operator<(const LaneKind& other) const { return tied() < other.tied(); }
};

namespace detail {

template <class Space>
std::optional<LaneKind> lane_kind_in(const RunSetup& setup) {
  const auto* const chain = dynamic_cast<const ChainSubject<Space>*>(setup.subject.get());
  const RunOptions& options = setup.options;
  if (chain == nullptr || chain->chain().loaded() || library_of<Space>().lanes(options) == nullptr) return {};
  LaneKind kind{Space::dimension, chain->chain().links(), 0, options.method, 0, 0, setup.every};
  if (options.method == Method::gauss) kind.stages = options.stages;
  (is_adaptive(options) ? kind.tolerance : kind.step) = is_adaptive(options) ? options.tolerance : options.step;
  return kind;
}

}  // namespace detail

/// The kind of a run that goes in lanes; none of others. Chains that gravity alone moves, by Gauss steps of the chain
/// solver, and as many of their stages as lanes were compiled for, or by explicit Runge–Kutta methods. It depends on
/// the run alone.
inline std::optional<LaneKind> lane_kind(const RunSetup& setup) {
  const RunOptions& options = setup.options;
  const double chosen = is_adaptive(options) ? options.tolerance : options.step;
  const bool fits = options.form == Form::momentum && options.solver != Solver::dense &&
                    options.iteration != Iteration::newton && chosen > 0 && std::isfinite(chosen) && setup.every >= 1 &&
                    setup.duration > 0 && std::isfinite(setup.duration) && !setup.rows.any() && !setup.doubted;
  if (!fits) return {};
  const std::optional<LaneKind> planar = detail::lane_kind_in<Planar>(setup);
  return planar ? planar : detail::lane_kind_in<Spatial>(setup);
}

namespace detail {

/// The members of runs of one kind, as the compiled library takes them, and what becomes of them.
template <class Space>
class PlainMembers {
 public:
  /// `setups` must outlive it.
  explicit PlainMembers(std::span<const RunSetup* const> setups)
      : q_(setups[0]->start.q.size(), static_cast<Eigen::Index>(setups.size())), v_(q_.rows(), q_.cols()) {
    for (std::size_t k = 0; k < setups.size(); ++k) {
      const Motion& start = setups[k]->start;
      const Chain<Space>& chain = static_cast<const ChainSubject<Space>&>(*setups[k]->subject).chain();
      const double end = start.time + setups[k]->duration;
      members_.push_back({plain(chain, {}), start.time, end, start.q.data(), start.v.data()});
      ends_.push_back({&q_(0, static_cast<Eigen::Index>(k)), &v_(0, static_cast<Eigen::Index>(k)), 0, {}, 0, 0, 0});
    }
  }

  /// False where `watch` made it leave off.
  bool move(MoveMembers& move_members, const RunOptions& options, std::int64_t every, LaneWatch& watch) {
    return move_members(options, every, members_, ends_, watch);
  }

  const PlainMemberEnd& end(std::size_t k) const { return ends_[k]; }
  Motion last(std::size_t k) const {
    const auto column = static_cast<Eigen::Index>(k);
    return {ends_[k].time, q_.col(column), v_.col(column)};
  }

 private:
  Eigen::MatrixXd q_, v_;
  std::vector<PlainMember> members_;
  std::vector<PlainMemberEnd> ends_;
};

}  // namespace detail

/// Runs of one kind, in lanes.
template <class Space>
class LaneRuns : private LaneWatch {
 public:
  /// `setups`, all of one lane_kind, must outlive it.
  LaneRuns(std::span<const RunSetup* const> setups, const std::function<bool()>& stop)
      : setups_(setups), stop_(stop), members_(setups) {
    watches_.reserve(setups.size());
    for (const RunSetup* setup : setups) {
      watches_.emplace_back(setup->events, detail::glance_degree(setup->options));
      if (!setup->events.empty()) watches_.back().start(setup->start);
      wants_steps_ |= !setup->events.empty();
    }
  }

  /// What came of each. One that lanes could not move, by steps of their own or at all, is run alone from its start.
  std::vector<RunReport> go() {
    reports_.assign(setups_.size(), {});
    move();
    for (std::size_t k = 0; k < setups_.size(); ++k) {
      if (stopped_) {
        reports_[k].end = RunEnd::stopped;
      } else if (!finish(k)) {
        reports_[k] = Run(*setups_[k]).go(stop_);
      }
    }
    return std::move(reports_);
  }

 private:
  void move() {
    const RunSetup& first = *setups_[0];
    stopped_ = !members_.move(*library_of<Space>().lanes(first.options), first.options, first.every, *this);
    for (std::size_t k = 0; k < setups_.size(); ++k) {
      if (reports_[k].end != RunEnd::event) reports_[k].last = members_.last(k);
    }
  }

  /// What a run would report; false where it did not come to its end.
  bool finish(std::size_t k) {
    const RunSetup& setup = *setups_[k];
    const PlainMemberEnd& end = members_.end(k);
    RunReport& report = reports_[k];
    const Subject& subject = *setup.subject;
    const Observation before = subject.observe(setup.start), after = subject.observe(report.last);
    if (end.status != Status::ok || !std::isfinite(before.energy) || !std::isfinite(after.energy)) return false;
    report.energy_error = {before.energy, detail::compared_with(subject.energy_scale(), before.energy), 0};
    const double last = std::abs(after.energy - before.energy);
    report.energy_error.largest = report.energy_error.of(before.energy + std::max(last, end.energy_error));
    report.energy_final = after.energy;
    report.rows = 1 + (end.steps + setup.every - 1) / setup.every;
    report.statistics.steps = end.steps;
    report.statistics.rejected_steps = end.rejected_steps;
    if (!is_explicit(setup.options.method)) report.description = {"chain", "fixed-point", ""};
    report.events = watches_[k].tallies();
    report.event_cost = watches_[k].cost();
    report.warnings = event_warnings(setup.events, report.events);
    return true;
  }

  // --- While they are moved ---

  /// The scalar stepper of one member, for what lanes do not show: it takes the last step again.
  struct Alone {
    std::size_t member = static_cast<std::size_t>(-1);
    std::unique_ptr<Integrator> integrator = nullptr;
    double begin = std::numeric_limits<double>::quiet_NaN();  // of the step that it has taken

    bool take(std::size_t of, const RunSetup& setup, const Motion& from, double end) {
      if (of != member) {
        RunOptions options = setup.options;
        options.step = 1;  // of the size that it is told
        options.solver = Solver::chain;
        options.iteration = Iteration::fixed_point;
        integrator = setup.subject->make_integrator(options);
        integrator->remember_steps(true);
        begin = std::numeric_limits<double>::quiet_NaN();
        member = of;
      }
      if (begin == from.time) return true;
      if (!integrator->start(from) || !integrator->step(end - from.time)) return false;
      begin = from.time;
      return true;
    }
  };

  /// The last step of the member in a lane, as an EventWatch looks into it.
  class Step {
   public:
    Step(LaneSteps& steps, int lane, const RunSetup& setup, Alone& alone)
        : steps_(steps), lane_(lane), setup_(setup), alone_(alone) {}

    void state(Motion& motion) const {
      prepare(steps_.end(lane_), motion);
      steps_.state(lane_, motion.q.data(), motion.v.data());
    }
    void glance(double share, double time, Motion& motion) const {
      prepare(time, motion);
      steps_.glance(lane_, share, motion.q.data(), motion.v.data());
    }
    bool look(const Motion& begin, double time, Motion& motion) {
      prepare(time, motion);
      const double share = (time - begin.time) / (steps_.end(lane_) - begin.time);
      if (steps_.look(lane_, share, motion.q.data(), motion.v.data())) return true;
      return alone_.take(steps_.member(lane_), setup_, begin, steps_.end(lane_)) &&
             alone_.integrator->look(time, motion);
    }

   private:
    void prepare(double time, Motion& motion) const {
      motion.time = time;
      motion.q.resize(setup_.start.q.size());
      motion.v.resize(setup_.start.v.size());
    }

    LaneSteps& steps_;
    int lane_;
    const RunSetup& setup_;
    Alone& alone_;
  };

  bool wants_steps() const override { return wants_steps_; }
  bool stops() override { return stop_(); }

  void after_step(LaneSteps& steps) override {
    alone_.resize(static_cast<std::size_t>(steps.lanes()));
    for (int lane = 0; lane < steps.lanes(); ++lane) {
      if (steps.took_step(lane)) look_into(steps, lane);
    }
  }

  void look_into(LaneSteps& steps, int lane) {
    const std::size_t k = steps.member(lane);
    const RunSetup& setup = *setups_[k];
    if (setup.events.empty()) return;
    for (const Occurrence& happened :
         watches_[k].after_step(Step(steps, lane, setup, alone_[static_cast<std::size_t>(lane)]))) {
      if (!setup.events[happened.event].stop) continue;
      reports_[k].end = RunEnd::event;
      reports_[k].ended_by = happened.event;
      reports_[k].last = happened.motion;
      steps.finish(lane);
    }
  }

  std::span<const RunSetup* const> setups_;
  const std::function<bool()>& stop_;
  std::vector<EventWatch> watches_;
  detail::PlainMembers<Space> members_;
  std::vector<RunReport> reports_;
  std::vector<Alone> alone_;  // of each lane
  bool wants_steps_ = false, stopped_ = false;
};

}  // namespace pendula
