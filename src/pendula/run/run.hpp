#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <memory>
#include <pendula/run/checkpoint.hpp>
#include <pendula/run/doubts.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/run_record.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/simulation.hpp>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

/// One run of anything that moves, once.
class Run {
 public:
  /// Throws std::invalid_argument on options that make no sense, NoKernel.
  explicit Run(RunSetup setup);

  /// What is odd about it already: one sentence each.
  std::vector<std::string> expected_trouble() const { return setup_.subject->expected_trouble(setup_.options); }

  /// What really runs.
  Description description() const { return integrator_->describe(); }

  /// Hands every row to `observer`, which must outlive the run.
  void add(Observer& observer) { observers_.push_back(&observer); }

  /// Runs to the end, or until `stop`, asked after every step, says so. Then looks for reasons to doubt what came out,
  /// which may take a second run with longer steps. A run that fails throws nothing: the report says so.
  RunReport go(const std::function<bool()>& stop = [] { return false; });

  /// The same from where a run with this setup, but for its end, had come to: as if that had never stopped. Observers
  /// get the rows that are new. Throws std::invalid_argument where a checkpoint is of something else.
  RunReport go_on(
      const Checkpoint& checkpoint, const std::function<bool()>& stop = [] { return false; });

 private:
  /// Ends a run at a state that is no row.
  struct NotFinite {};

  RunReport go(const Checkpoint* from, const std::function<bool()>& stop);
  void integrate(const Checkpoint* from, const std::function<bool()>& stop, RunReport& report);
  void take(const Motion& motion);
  Observation look_at(const Motion& motion);
  void come_by(const RowPlace& place, bool last);
  void finish(RunReport& report);

  RunSetup setup_;
  std::unique_ptr<Integrator> integrator_;
  std::vector<Observer*> observers_;
  RunRecord record_;       // of the rows; where those are wanted at times, of the first and the last state, too
  std::int64_t rows_ = 0;  // that there were
  std::vector<double> row_;
  std::chrono::steady_clock::time_point kept_ = std::chrono::steady_clock::now();
};

inline Run::Run(RunSetup setup)
    : setup_(std::move(setup)),
      integrator_(setup_.subject->make_integrator(setup_.options)),
      record_(*setup_.subject, setup_.start, setup_.duration) {}

inline RunReport Run::go(const std::function<bool()>& stop) {
  return go(nullptr, stop);
}

inline RunReport Run::go_on(const Checkpoint& checkpoint, const std::function<bool()>& stop) {
  integrator_->resume(checkpoint.integrator);
  become(record_, checkpoint.record);
  return go(&checkpoint, stop);
}

inline RunReport Run::go(const Checkpoint* from, const std::function<bool()>& stop) {
  RunReport report;
  report.stepping_seconds = std::nan("");
  integrate(from, stop, report);
  finish(report);
  report.last = record_.last();
  report.rows = rows_;
  report.description = integrator_->describe();
  report.statistics = integrator_->statistics();
  report.energy_error = record_.energy_error();
  report.energy_final = record_.energy();
  report.table = record_.table();
  if (report.end == RunEnd::complete && setup_.doubted)
    report.warnings = doubts(setup_, report, record_.balance(), stop);
  return report;
}

inline void Run::integrate(const Checkpoint* from, const std::function<bool()>& stop, RunReport& report) {
  const RunOptions& options = setup_.options;
  const double largest_step = is_adaptive(options.method) ? std::numeric_limits<double>::infinity() : options.step;
  const Schedule schedule{largest_step, setup_.duration, setup_.every, setup_.rows};
  const auto on_row = [&](const Motion& motion) { take(motion); };
  const auto on_way = [&](const RowPlace& place, bool last) { come_by(place, last); };
  rows_ = from == nullptr ? 0 : from->rows;
  try {
    if (from == nullptr && setup_.rows.any() && setup_.rows.at(0) != 0) look_at(setup_.start);
    const RunResult result = from == nullptr ? simulate(*integrator_, setup_.start, schedule, on_row, stop, on_way)
                                             : pendula::go_on(*integrator_, setup_.start.time, schedule,
                                                              {from->rows, from->since_row}, on_row, stop, on_way);
    if (setup_.rows.any() && integrator_->time() != record_.last().time) look_at(integrator_->state());
    report.stepping_seconds = result.stepping_seconds;
    report.step = result.outcome;
    report.end = !result.outcome ? RunEnd::step_failed : result.stopped ? RunEnd::stopped : RunEnd::complete;
  } catch (const NotFinite&) {
    report.end = RunEnd::not_finite;
    report.step.time = integrator_->time();
  } catch (...) {
    report.end = RunEnd::observer_failed;
    report.failure = std::current_exception();
  }
}

inline void Run::take(const Motion& motion) {
  const Observation seen = look_at(motion);
  ++rows_;
  for (Observer* observer : observers_) observer->take({motion, seen, row_});
}

// The energy is not finite wherever anything else is not.
inline Observation Run::look_at(const Motion& motion) {
  Observation seen = setup_.subject->observe(motion);
  if (!std::isfinite(seen.energy)) throw NotFinite();
  row_.clear();
  setup_.subject->append_row(motion, seen, row_);
  record_.add(motion, seen, row_, integrator_->statistics().load_work);
  return seen;
}

inline void Run::come_by(const RowPlace& place, bool last) {
  using Clock = std::chrono::steady_clock;
  const auto wants = [](const Observer* observer) { return observer->wants_checkpoint(); };
  if (!last && std::ranges::none_of(observers_, wants)) {
    if (std::isinf(setup_.checkpoint)) return;
    const Clock::time_point now = Clock::now();
    if (std::chrono::duration<double>(now - kept_).count() < setup_.checkpoint) return;
    kept_ = now;
  }
  const Checkpoint checkpoint{integrator_->time(), place.rows, place.since_row, integrator_->member(),
                              member_of(record_)};
  for (Observer* observer : observers_) observer->keep(checkpoint);
}

// The first failure is the one that is told.
inline void Run::finish(RunReport& report) {
  for (Observer* observer : observers_) {
    try {
      observer->finish();
    } catch (...) {
      if (report.end != RunEnd::complete && report.end != RunEnd::stopped) continue;
      report.end = RunEnd::observer_failed;
      report.failure = std::current_exception();
    }
  }
}

}  // namespace pendula
