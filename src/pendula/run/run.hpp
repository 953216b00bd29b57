#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <pendula/run/accuracy.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/event_watch.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/run_record.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/run/track.hpp>
#include <pendula/run/trust.hpp>
#include <pendula/run/viewer.hpp>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

/// One run of any subject; runs once.
class Run {
 public:
  /// Throws std::invalid_argument for options that make no sense, and NoKernel.
  explicit Run(RunSetup setup);

  /// Problems known before the run, one sentence each.
  std::vector<std::string> expected_trouble() const { return setup_.subject->expected_trouble(setup_.options); }

  /// What was asked for; of a run that went on, with the rows that it began with.
  const RunSetup& setup() const { return setup_; }

  /// What actually runs.
  const Description& description() const { return description_; }

  /// Passes every row to `observer`, which must outlive the run.
  void add(Observer& observer) {
    observers_.push_back(&observer);
    takers_.push_back(&observer);
  }

  /// Passes rows at `times` instead of the rows of the run.
  void add(Observer& observer, const RowTimes& times) {
    observers_.push_back(&observer);
    viewers_.emplace_back(*setup_.subject, observer, times);
  }

  /// Runs to the end, or until `stop`, asked after every step, says so. Then looks for reasons not to trust the result,
  /// which may take a second run with longer steps. A failing run does not throw: the report says how it failed.
  RunReport go(const std::function<bool()>& stop = [] { return false; });

  /// Continues from a checkpoint of a run with the same setup except for its end, as if that run had never stopped.
  /// Observers receive the new rows only. Throws std::invalid_argument if the checkpoint belongs to something else.
  RunReport go_on(
      const Checkpoint& checkpoint, const std::function<bool()>& stop = [] { return false; });

 private:
  /// Thrown to end a run at a state that cannot be a row.
  struct NotFinite {};

  RunReport go(const Checkpoint* from, const std::function<bool()>& stop);
  Track try_out(const RunOptions& options, double share, Track track,
                const std::function<bool(const Track&)>& stop) const;
  Track own_track() const {
    return Track(is_adaptive(setup_.options) ? Track::apart / 2 : Track::apart).with_fast_places();
  }
  void go_by_series(double tolerance);
  void choose_stages(RunOptions& options) const;
  bool aim(const std::function<bool()>& stop);
  void follow_aim();
  bool is_aimed() const { return setup_.accuracy.error > 0 && is_adaptive(setup_.options); }
  void integrate(const Checkpoint* from, const std::function<bool()>& stop, RunReport& report);
  void take(const Motion& motion, double work);
  std::optional<Motion> take_events(RunReport& report);
  void tell(const Occurrence& happened);
  void view(const std::optional<Motion>& end);
  Observation look_at(const Motion& motion, double work);
  void look_at_end(const RunResult& result);
  void come_by(const RowPlace& place, bool last);
  void conclude(RunReport& report);
  void finish(RunReport& report);
  void judge(RunReport& report, bool went_on, const std::function<bool()>& stop);
  detail::Warning look_again(RunReport& report, const std::function<bool()>& stop);

  /// The state of a run besides its integrator, for checkpoints.
  struct CheckpointState {
    RunRecord record;  // of the rows; with rows at times also of the first and the last state
    EventWatch watch;
    AccuracyAim aim;
    double series = 0;               // tolerance of the series that were chosen; 0: none were
    double every = 0, interval = 0;  // of rows

    template <class Numbers>
    void member(Numbers& numbers) {
      numbers(record, watch, aim, series, every, interval);
    }
  };

  RunSetup setup_;
  RunOptions asked_;
  std::unique_ptr<Integrator> integrator_;     // one at a time: for a million links it takes a gigabyte
  std::vector<Observer*> observers_, takers_;  // all of them; those that take the rows of the run
  std::vector<Viewer> viewers_;                // observers with row times of their own
  double viewing_seconds_ = 0;
  std::optional<Track> track_;  // of this run, if another is compared with it
  CheckpointState kept_;
  Description description_;
  std::string method_reason_;
  std::int64_t rows_ = 0;           // so far
  double step_ = 0, step_end_ = 0;  // size and end of the last step
  std::optional<double> missed_;    // start of the first step with too large a defect
  std::vector<double> row_, event_row_;
  std::chrono::steady_clock::time_point kept_at_ = std::chrono::steady_clock::now();
};

}  // namespace pendula
