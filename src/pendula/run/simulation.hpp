#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <pendula/run/integrator.hpp>
#include <pendula/system/outcome.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {

/// How long a run is, and which of its states are wanted.
struct Schedule {
  double step = 1e-3;       ///< s; for adaptive methods the largest step, may be infinite
  double duration = 10;     ///< s; the last step is cut so that the run ends there
  std::int64_t every = 10;  ///< steps from row to row; the first and the last state are always rows
};

/// What came of a run.
struct RunResult {
  Outcome outcome;              ///< of the step that ended it
  bool stopped = false;         ///< whether it was asked to end before its time
  double stepping_seconds = 0;  ///< wall time inside the integrator, without rows
};

namespace detail {

inline void require(const Schedule& schedule) {
  const auto reject = [](const char* what) { throw std::invalid_argument(std::string("schedule: ") + what); };
  if (!(schedule.step > 0)) reject("step: expected a positive number");
  if (!(schedule.duration >= 0) || std::isinf(schedule.duration)) reject("duration: expected a number, not negative");
  if (schedule.every < 1) reject("every: expected at least 1");
}

/// Size of the next step. A rest that is one step but for rounding is taken as one step, not as a step and a sliver.
inline double next_step(const Schedule& schedule, double elapsed) {
  const double rest = schedule.duration - elapsed;
  return rest <= schedule.step * (1 + 1e-9) ? rest : schedule.step;
}

/// Whether the end may have a say in a step that is to be `h`, after one of the size `last`, 0 where that is unknown.
/// An adaptive method's next step is never ten times as long.
inline bool may_be_cut(const Schedule& schedule, double h, double last) {
  return h != schedule.step && (last == 0 || h <= 10 * last);
}

inline bool at_end(const Schedule& schedule, double elapsed) {
  const double ulp = std::numeric_limits<double>::epsilon() * schedule.duration;
  return schedule.duration - elapsed <= 4 * ulp;
}

}  // namespace detail

/// Runs `integrator`, which `since_row` steps ago was at a row, on to the end of a schedule that began at the time
/// `begin`. Calls on_row(const Motion&) every `schedule.every` accepted steps, and at the last state, also where the
/// run fails or is stopped: bool stop() is asked after every step. Calls on_way(since_row, last) where a longer run
/// would come by as well: where it begins, at every row, before a step that the end may cut short, and where the run
/// fails or is stopped between rows; `last` tells that there may be none after it.
template <class OnRow, class Stop, class OnWay>
RunResult go_on(Integrator& integrator, double begin, const Schedule& schedule, std::int64_t since_row, OnRow on_row,
                const Stop& stop, OnWay on_way) {
  using Clock = std::chrono::steady_clock;
  detail::require(schedule);
  const auto is_over = [&] { return detail::at_end(schedule, integrator.time() - begin); };
  RunResult result;
  bool near_end = false;
  on_way(since_row, true);
  while (result.outcome && !result.stopped && !is_over()) {
    const auto before = Clock::now();
    while (since_row < schedule.every && result.outcome && !result.stopped) {
      if (is_over()) break;
      const double h = detail::next_step(schedule, integrator.time() - begin);
      const bool was_near = std::exchange(near_end, detail::may_be_cut(schedule, h, result.outcome.step));
      if (near_end && !was_near) on_way(since_row, true);
      result.outcome = integrator.step(h);
      if (result.outcome) ++since_row;
      result.stopped = stop();
    }
    result.stepping_seconds += std::chrono::duration<double>(Clock::now() - before).count();
    const bool is_row = since_row == schedule.every;
    if (!is_row && !near_end) on_way(since_row, true);
    if (since_row > 0) on_row(integrator.state());
    since_row = 0;
    if (is_row && !near_end) {
      on_way(since_row, !result.outcome || result.stopped || is_over());
    }
  }
  return result;
}

/// Runs `integrator` from `start`, which is a row, over `schedule`. Throws std::invalid_argument on a schedule that
/// makes no sense.
template <class OnRow, class Stop, class OnWay>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row,
                   const Stop& stop, OnWay on_way) {
  detail::require(schedule);
  const Outcome started = integrator.start(start);
  on_row(start);
  if (!started) return {.outcome = started};
  return go_on(integrator, start.time, schedule, 0, on_row, stop, on_way);
}

/// The same without a way.
template <class OnRow, class Stop>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row,
                   const Stop& stop) {
  return simulate(integrator, start, schedule, on_row, stop, [](std::int64_t, bool) {});
}

/// The same to the end of the schedule.
template <class OnRow>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row) {
  return simulate(integrator, start, schedule, on_row, [] { return false; });
}

}  // namespace pendula
