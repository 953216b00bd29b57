#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <pendula/run/integrator.hpp>
#include <pendula/system/outcome.hpp>
#include <stdexcept>
#include <string>

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

inline bool at_end(const Schedule& schedule, double elapsed) {
  const double ulp = std::numeric_limits<double>::epsilon() * schedule.duration;
  return schedule.duration - elapsed <= 4 * ulp;
}

}  // namespace detail

/// Runs `integrator` from `start` over `schedule`, and calls on_row(const Motion&) at the start, every
/// `schedule.every` accepted steps, and at the last state, also where the run fails or is stopped: bool stop() is asked
/// after every step. Throws std::invalid_argument on a schedule that makes no sense.
template <class OnRow, class Stop>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row,
                   const Stop& stop) {
  using Clock = std::chrono::steady_clock;
  detail::require(schedule);
  RunResult result{integrator.start(start)};
  on_row(start);
  std::int64_t since_row = 0;
  while (result.outcome && !result.stopped && !detail::at_end(schedule, integrator.time() - start.time)) {
    const auto begin = Clock::now();
    while (since_row < schedule.every && result.outcome && !result.stopped) {
      const double elapsed = integrator.time() - start.time;
      if (detail::at_end(schedule, elapsed)) break;
      result.outcome = integrator.step(detail::next_step(schedule, elapsed));
      if (result.outcome) ++since_row;
      result.stopped = stop();
    }
    result.stepping_seconds += std::chrono::duration<double>(Clock::now() - begin).count();
    if (since_row > 0) on_row(integrator.state());
    since_row = 0;
  }
  return result;
}

/// The same to the end of the schedule.
template <class OnRow>
RunResult simulate(Integrator& integrator, const Motion& start, const Schedule& schedule, OnRow on_row) {
  return simulate(integrator, start, schedule, on_row, [] { return false; });
}

}  // namespace pendula
