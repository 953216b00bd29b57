#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// Hands rows to an observer at times of its own, whatever the rows of the run are: a picture moves evenly by them. The
/// last state is a row, too. It looks into steps (Integrator::remember_steps), which neither the steps nor the rows of
/// the run depend on.
class Viewer {
 public:
  Viewer(const Subject& subject, Observer& observer, RowTimes times)
      : subject_(&subject), observer_(&observer), times_(std::move(times)) {}

  /// Rows are of this subject from now on, which has the same columns.
  void show(const Subject& subject) { subject_ = &subject; }

  /// A run of which rows are counted from the time `start` begins in this state, or goes on from it.
  void begin(const Motion& state, double start) {
    start_ = start;
    if (state.time == start && times_.at(0) == 0) show(state);
    while (start + times_.at(next_) <= state.time) ++next_;
  }

  /// After every step, of this size, which the run ends at `end` within, if it does.
  void follow(Integrator& integrator, const std::optional<Motion>& end, double step) {
    step_ = step;
    for (double time = 0; is_reached(time = times_.at(next_), integrator.time() - start_); ++next_) {
      if (end && start_ + time > end->time) return;
      Motion there;
      show(integrator.look(start_ + time, there) ? there : integrator.glance(start_ + time));
    }
  }

  /// The run is over, in this state.
  void finish(const Motion& last) {
    if (!is_reached(last.time - start_, shown_ - start_)) show(last);
  }

 private:
  // What is not finite ends the run by itself.
  void show(const Motion& motion) {
    const Observation seen = subject_->observe(motion);
    if (!std::isfinite(seen.energy)) return;
    row_.clear();
    subject_->append_row(motion, seen, row_);
    observer_->take({motion, seen, row_, step_});
    shown_ = motion.time;
  }

  const Subject* subject_;
  Observer* observer_;
  RowTimes times_;
  std::int64_t next_ = 0;                                    // number of the row that comes next
  double start_ = 0;                                         // what times count from
  double step_ = 0;                                          // size of the last step
  double shown_ = -std::numeric_limits<double>::infinity();  // time of the last row
  std::vector<double> row_;
};

}  // namespace pendula
