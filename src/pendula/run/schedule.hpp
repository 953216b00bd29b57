#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/step_rules.hpp>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

namespace pendula {

/// Length of a run, and which of its states become rows.
struct Schedule {
  double step = 1e-3;       ///< for adaptive methods the largest step, may be infinite  [s]
  double duration = 10;     ///< the last step is cut to end there  [s]
  std::int64_t every = 10;  ///< steps from row to row; the first and the last state are always rows
  RowTimes rows = {};       ///< if any: rows at these times instead of `every`; chosen ones also at the last state
};

/// Result of a run.
struct RunResult {
  Outcome outcome;       ///< of the step that ended it
  bool stopped = false;  ///< whether it was asked to stop early
  /// The state within the last step at which it ended.
  std::optional<Motion> end = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  double stepping_seconds = 0;     ///< wall time in the integrator, without rows
};

namespace detail {

inline void require(const Schedule& schedule) {
  const auto reject = [](const char* what) { throw std::invalid_argument(std::string("schedule: ") + what); };
  if (!(schedule.step > 0)) reject("step: expected a positive number");
  if (!(schedule.duration >= 0) || std::isinf(schedule.duration)) reject("duration: expected a number, not negative");
  if (schedule.every < 1) reject("every: expected at least 1");
  if (!(schedule.rows.interval >= 0)) reject("rows: expected an interval that is not negative");
  if (!std::ranges::is_sorted(schedule.rows.times)) reject("rows: expected ascending times");
}

/// Size of the next step. A remainder that is one step up to rounding is taken as one step.
inline double next_step(const Schedule& schedule, double elapsed) {
  const double rest = schedule.duration - elapsed;
  return ends_before(schedule.step, rest) ? schedule.step : rest;
}

/// Whether the end of the run may affect a step planned to be `h`, after one of size `last`, 0 if unknown. The next
/// step of an adaptive method is never ten times as long.
inline bool may_be_cut(const Schedule& schedule, double h, double last) {
  return h != schedule.step && (last == 0 || h <= 10 * last);
}

inline bool at_end(const Schedule& schedule, double elapsed) {
  const double ulp = std::numeric_limits<double>::epsilon() * schedule.duration;
  return schedule.duration - elapsed <= 4 * ulp;
}

}  // namespace detail

/// Position of a run among its rows.
struct RowPlace {
  std::int64_t rows = 0;       ///< so far
  std::int64_t since_row = 0;  ///< steps since the last row; 0 for rows at times
};

namespace detail {

/// on_step that ends the run at no step.
inline constexpr auto runs_on = [] { return std::optional<Motion>(); };

/// State and callbacks of a run: see go_on.
template <class OnRow, class Stop, class OnWay, class OnStep>
struct Course {
  Integrator& integrator;
  double begin;
  const Schedule& schedule;
  RowPlace place;
  OnRow on_row;
  const Stop& stop;
  OnWay on_way;
  OnStep on_step;
  RunResult result = {};
  bool is_cut_off = false;  // stopped within a step or its rows: cannot be continued from there
  bool near_end = false;    // whether the end may have affected a step: a longer run would not pass here

  double elapsed() const { return integrator.time() - begin; }
  bool is_over() const { return at_end(schedule, elapsed()); }
  bool goes_on() const { return result.outcome && !result.stopped && !result.end; }

  void step() {
    const double h = next_step(schedule, elapsed());
    const bool may_depend = integrator.depends_on_end(h) || may_be_cut(schedule, h, result.outcome.step);
    const bool was_near = std::exchange(near_end, may_depend);
    if (near_end && !was_near) on_way(place, true);
    result.outcome = integrator.step(h);
    if (result.outcome.status == Status::interrupted) return cut_off();
    if (result.outcome) result.end = on_step();
    result.stopped = stop();
  }

  void cut_off() {
    result.outcome = {};
    result.stopped = is_cut_off = true;
  }

  void row(const Motion& motion, double work) {
    if constexpr (std::is_invocable_v<OnRow, const Motion&, double>) {
      on_row(motion, work);
    } else {
      on_row(motion);
    }
    last_row = motion.time;
    ++place.rows;
    place.since_row = 0;
  }

  void come_by() {
    if (!near_end && !result.end && !is_cut_off) on_way(place, !goes_on() || is_over());
  }

  /// Steps to the next row, every so many steps.
  void to_next_row() {
    while (place.since_row < schedule.every && goes_on() && !is_over()) {
      step();
      if (result.outcome && !is_cut_off) ++place.since_row;
    }
  }
  void take_row() {
    if (result.end) {
      if (result.end->time != last_row) row_at(result.end->time);
      return;
    }
    const bool is_row = place.since_row == schedule.every;
    if (!is_row) come_by();
    if (place.since_row > 0) row(integrator.state(), integrator.statistics().load_work);
    if (is_row) come_by();
  }

  /// For rows at times: steps until one step contains rows.
  void to_next_times() {
    while (goes_on() && !is_over()) {
      step();
      if (result.outcome && is_reached(schedule.rows.at(place.rows), elapsed())) return;
    }
  }
  void take_times() {
    using Clock = std::chrono::steady_clock;
    constexpr std::chrono::milliseconds long_time(200);  // for the rows of one step: beyond it the run is cut off
    if (!result.outcome) return come_by();
    const auto began = Clock::now();
    for (double time = 0; is_reached(time = schedule.rows.at(place.rows), elapsed());) {
      if (result.end && begin + time > result.end->time) break;
      if (!row_at(begin + time)) return;
      if (Clock::now() - began > long_time && stop()) return cut_off();
    }
    come_by();
  }

  /// The last state, unless it is a row.
  void take_last() {
    const double end = result.end ? result.end->time : integrator.time();
    if (place.rows > 0 && is_reached(end - begin, schedule.rows.at(place.rows - 1))) return;
    if (result.end) {
      row_at(end);
    } else {
      row(integrator.state(), integrator.statistics().load_work);
    }
  }

  /// A row within the last step.
  bool row_at(double time) {
    Motion motion;
    double work = 0;
    const Outcome looked = integrator.at_full_order(time, motion, work);
    if (looked) {
      row(motion, work);
    } else if (looked.status == Status::interrupted) {
      cut_off();
    } else {
      result.outcome = looked;
    }
    return bool(looked);
  }

  double last_row = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace detail

/// Runs `integrator`, which is at `place`, to the end of a schedule that began at the time `begin`.
///
/// Calls on_row(const Motion&), or on_row(const Motion&, double work) with the work of loads until then, every
/// `schedule.every` accepted steps and at the last state, also if the run fails or is stopped; or else at the times of
/// `schedule.rows`, which do not affect the steps. Asks bool stop() after every step. Calls on_way(place, last) where a
/// longer run would pass as well: where it begins, at rows, before a step that the end may cut short, and where the run
/// fails or is stopped; `last` tells that there may be no further call. Asks std::optional<Motion> on_step() after
/// every accepted step whether the run ends within it, at that state.
template <class OnRow, class Stop, class OnWay, class OnStep = decltype(detail::runs_on)>
RunResult go_on(Integrator& integrator, double begin, const Schedule& schedule, const RowPlace& place, OnRow on_row,
                const Stop& stop, OnWay on_way, OnStep on_step = detail::runs_on) {
  using Clock = std::chrono::steady_clock;
  detail::require(schedule);
  detail::Course<OnRow, Stop, OnWay, OnStep> course{integrator, begin, schedule, place, on_row, stop, on_way, on_step};
  const bool at_times = schedule.rows.any();
  if (at_times) integrator.remember_steps(true);
  const ScopedStopSign sign(integrator, stop_sign(stop));
  on_way(place, true);
  while (course.goes_on() && !course.is_over()) {
    const auto before = Clock::now();
    at_times ? course.to_next_times() : course.to_next_row();
    course.result.stepping_seconds += std::chrono::duration<double>(Clock::now() - before).count();
    at_times ? course.take_times() : course.take_row();
  }
  if (at_times && schedule.rows.chosen) course.take_last();
  return course.result;
}

/// Runs `integrator` from `start`, which is a row unless rows are wanted at other times, over `schedule`. Callbacks as
/// for go_on. Throws std::invalid_argument for a schedule that makes no sense.
template <class OnRow, class Stop, class OnWay, class OnStep = decltype(detail::runs_on)>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row,
                   const Stop& stop, OnWay on_way, OnStep on_step = detail::runs_on) {
  detail::require(schedule);
  const Outcome started = integrator.start(start);
  const bool is_row = !schedule.rows.any() || schedule.rows.at(0) == 0;
  if (is_row) on_row(start);  // no work yet
  if (!started) return {.outcome = started};
  return go_on(integrator, start.time, schedule, {is_row ? 1 : 0, 0}, on_row, stop, on_way, on_step);
}

/// Without on_way.
template <class OnRow, class Stop>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row,
                   const Stop& stop) {
  return simulate(integrator, start, schedule, on_row, stop, [](const RowPlace&, bool) {});
}

/// Without stop.
template <class OnRow>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row) {
  return simulate(integrator, start, schedule, on_row, [] { return false; });
}

}  // namespace pendula
