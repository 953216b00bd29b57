#pragma once

#include <cstdint>
#include <pendula/run/event.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/member.hpp>
#include <pendula/system/motion.hpp>
#include <span>

namespace pendula {

/// Where a run can be continued: with the same subject, start and options, and any later end, as if it had never
/// stopped, to the last bit.
struct Checkpoint {
  double time = 0;             ///< of the state  [s]
  std::int64_t rows = 0;       ///< so far, without rows that were written only because the run ended
  std::int64_t since_row = 0;  ///< steps since the last row
  Member integrator;
  Member record;  ///< state of the rows and events (RunRecord, EventWatch)
};

/// One row of a run.
struct Row {
  const Motion& motion;
  const Observation& seen;
  std::span<const double> numbers;  ///< in the order of Subject::columns
  double step = 0;                  ///< size of the step that contains it  [s]; 0 at the start
};

/// An event of a run, and the row at its instant.
struct EventRow {
  const Event& event;
  bool up;  ///< from − to +
  Row row;
};

/// Receives the rows of a run: a file, a picture, a progress line. An exception that it throws ends the run; the rows
/// so far are kept.
class Observer {
 public:
  Observer() = default;
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;
  virtual ~Observer() = default;

  virtual void take(const Row& row) = 0;

  /// Receives an event, in order of time: before later rows, and after those of earlier steps.
  virtual void happen(const EventRow&) {}

  /// Receives a point from which the run can be continued, after the rows up to there.
  virtual void keep(const Checkpoint&) {}
  /// Whether the next checkpoint is wanted regardless of wall time.
  virtual bool wants_checkpoint() const { return false; }

  /// Called after the last row, however the run ended.
  virtual void finish() {}
};

}  // namespace pendula
