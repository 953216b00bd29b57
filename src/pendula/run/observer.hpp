#pragma once

#include <pendula/run/checkpoint.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <span>

namespace pendula {

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
