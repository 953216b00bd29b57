#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <pendula/run/observer.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/run/step_view.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// Passes rows to an observer at times of its own, independent of the rows of the run, as an animation needs. The last
/// state is a row, too. Steps have to be remembered (Integrator::remember_steps); neither they nor the rows of the run
/// depend on a viewer.
class Viewer {
 public:
  Viewer(const Subject& subject, Observer& observer, RowTimes times)
      : subject_(&subject), observer_(&observer), times_(std::move(times)) {}

  /// Uses another subject, with the same columns, from now on.
  void show(const Subject& subject) { subject_ = &subject; }

  /// A run starts or continues in this state; row times count from `start`.
  void begin(const Motion& state, double start) {
    start_ = start;
    if (state.time == start && times_.at(0) == 0) show(state);
    while (start + times_.at(next_) <= state.time) ++next_;
  }

  /// Call after every step, of size `h`. `end` is the state at which the run ended within it, if it did.
  void follow(StepView& step, const std::optional<Motion>& end, double h) {
    step_ = h;
    for (double time = 0; is_reached(time = times_.at(next_), step.time() - start_); ++next_) {
      if (end && start_ + time > end->time) return;
      Motion there;
      if (!step.at_full_order(start_ + time, there)) step.at(start_ + time, there);
      show(there);
    }
  }

  /// The run ends in this state.
  void finish(const Motion& last) {
    if (!is_reached(last.time - start_, shown_ - start_)) show(last);
  }

 private:
  // A state that is not finite is left out; the run itself ends by it.
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
  std::int64_t next_ = 0;                                    // index of the next row
  double start_ = 0;                                         // origin of the row times
  double step_ = 0;                                          // size of the last step
  double shown_ = -std::numeric_limits<double>::infinity();  // time of the last row
  std::vector<double> row_;
};

}  // namespace pendula
