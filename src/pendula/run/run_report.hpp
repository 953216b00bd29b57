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

/// What is run, from where, and how.
struct RunSetup {
  std::shared_ptr<const Subject> subject;
  Motion start;
  RunOptions options;
  double duration = 10;     ///< s
  std::int64_t every = 10;  ///< steps from row to row; the first and the last state are always rows
  RowTimes rows = {};       ///< where there are any, in place of `every`: rows there and nowhere else
  Accuracy accuracy = {};   ///< of runs by tolerance, which follows from it by trials where it has an error
  bool doubted = true;      ///< whether to look for reasons to doubt it
  bool estimate = true;     ///< whether to run a second time to see how far it can be trusted, where it is doubted
  double checkpoint = std::numeric_limits<double>::infinity();  ///< of wall time from one checkpoint to the next  [s]
  /// To look for.
  std::vector<Event> events = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
};

/// How far a run can be trusted, as another one tells.
struct Trust {
  /// The largest error of its rows and events, relative to the size and the speed of the motion; NaN where that is not
  /// known.
  double expected_error = std::numeric_limits<double>::quiet_NaN();
  /// Up to where they are as accurate as was asked for, or to a thousandth where nothing was  [s].
  double until = std::numeric_limits<double>::infinity();
};

/// Why a run was over.
enum class RunEnd {
  complete,         ///< it came to its end
  event,            ///< it came to an event that ends it, RunReport::ended_by
  stopped,          ///< it was asked to stop
  step_failed,      ///< RunReport::step says how
  not_finite,       ///< the energy of its last state is not a number; that state is no row
  observer_failed,  ///< RunReport::failure is what an observer threw
};

/// All that is known of a run when it is over. A run that failed has everything up to there.
struct RunReport {
  RunEnd end = RunEnd::complete;
  Outcome step;                ///< the last one
  std::exception_ptr failure;  ///< of an observer
  Motion last;                 ///< the last state that is a row; the start where none is
  std::int64_t rows = 0;
  RunOptions options;                ///< that it was run by
  std::optional<AccuracyAim> aimed;  ///< of RunSetup::accuracy
  Trust trust;                       ///< where it was doubted
  Description description;
  Statistics statistics;
  double stepping_seconds = 0;  ///< wall time in the stepping loop alone; NaN where a row ended the run
  EnergyError energy_error;
  double energy_final = 0;         ///< of the last row  [J]
  std::vector<TableRow> table;     ///< a few rows, evenly over the run, the last one among them
  std::vector<EventTally> events;  ///< of each of RunSetup::events
  std::size_t ended_by = 0;        ///< number of an event, where one ended the run
  EventCost event_cost;
  std::vector<std::string> warnings;  ///< why not to trust a run that ended well: one sentence each
};

}  // namespace pendula
