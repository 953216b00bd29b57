#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/run/accuracy.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/run/run_record.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <string>
#include <vector>

namespace pendula {

/// What is asked of a run, whatever it moves.
struct RunRequest {
  RunOptions options = {};
  double duration = 10;     ///< s
  std::int64_t every = 10;  ///< steps from row to row; the first and the last state are always rows
  RowTimes rows = {};       ///< if any: rows at these times instead of `every`
  Accuracy accuracy = {};   ///< if given, the tolerance is found from it by trials
  bool estimate = true;     ///< whether to run a second time to estimate the error, if judged
  double checkpoint = std::numeric_limits<double>::infinity();  ///< wall time between checkpoints  [s]
  bool chooses_method = false;  ///< whether Taylor series take the place of Gauss steps that take longer
};

/// What to run, from where, and how.
struct RunSetup : RunRequest {
  std::shared_ptr<const Subject> subject;
  Motion start;
  bool judged = true;  ///< whether to look for reasons not to trust the result
  /// Events to find.
  std::vector<Event> events = {};  // NOLINT(readability-redundant-member-init): left out in initializers
  double motion_tolerance = 0;     ///< that series were chosen for: that of `options` is one of a step then

  /// Whether to compare the run with another one, of which its error is estimated.
  bool is_estimated() const { return judged && estimate; }
};

/// How far a run can be trusted, found by comparison with another run.
struct Trust {
  /// Largest error of its rows and events, relative to the size and speed of the motion; NaN if unknown.
  double expected_error = std::numeric_limits<double>::quiet_NaN();
  /// Until when rows are as accurate as asked for, or to a thousandth if nothing was asked for  [s].
  double until = std::numeric_limits<double>::infinity();
};

/// Why a run ended.
enum class RunEnd {
  complete,         ///< it reached its end
  event,            ///< an event ended it: RunReport::ended_by
  stopped,          ///< it was asked to stop
  step_failed,      ///< a step failed: RunReport::step
  not_finite,       ///< the energy of its last state is not finite; that state is not a row
  observer_failed,  ///< an observer threw: RunReport::failure
};

/// Everything known about a run when it is over; for a failed run, up to the failure.
struct RunReport {
  RunEnd end = RunEnd::complete;
  Outcome step;                ///< the last step
  std::exception_ptr failure;  ///< of an observer
  Motion last;                 ///< the last state that is a row; the start if there is none
  std::int64_t rows = 0;
  RunOptions options;                ///< as used
  std::string method_reason;         ///< why this method; empty if it was asked for
  double motion_tolerance = 0;       ///< as RunSetup's
  std::optional<AccuracyAim> aimed;  ///< for RunSetup::accuracy
  Trust trust;                       ///< if the run was judged
  Description description;
  Statistics statistics;
  double stepping_seconds = 0;  ///< wall time in the stepping loop alone; NaN if a row ended the run
  EnergyError energy_error;
  double energy_final = 0;         ///< of the last row  [J]
  std::vector<TableRow> table;     ///< a few rows spread evenly over the run, including the last
  std::vector<EventTally> events;  ///< of each of RunSetup::events
  std::size_t ended_by = 0;        ///< index of the event that ended the run
  EventCost event_cost;
  std::vector<std::string> warnings;  ///< reasons not to trust a run that ended well: one sentence each
};

}  // namespace pendula
