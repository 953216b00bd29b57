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
  double step = 0;                  ///< s; size of the step that it lies in; 0 at the start
};

/// An event of a run: what happened, and the row that the instant would be.
struct EventRow {
  const Event& event;
  bool up;  ///< from − to +
  Row row;
};

/// Takes the rows of a run: a file, a picture, a line that shows how far it is. What it throws ends the run, which
/// keeps all that it has.
class Observer {
 public:
  Observer() = default;
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;
  virtual ~Observer() = default;

  virtual void take(const Row& row) = 0;

  /// What happened, as it comes: before later rows, and after those of the steps before.
  virtual void happen(const EventRow&) {}

  /// Where the run may go on from, once it is over: after the rows that it has come by.
  virtual void keep(const Checkpoint&) {}
  /// Whether the next place to go on from is wanted, whatever the time.
  virtual bool wants_checkpoint() const { return false; }

  /// After the last row, however the run ended.
  virtual void finish() {}
};

}  // namespace pendula
