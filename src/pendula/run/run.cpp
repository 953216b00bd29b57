#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/run/method_choice.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/run/trust.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {

namespace {

// Most steps of a trial by steps of another kind: few_steps + times_as_many * (steps of the finest trial).
constexpr std::int64_t few_steps = 1000, times_as_many = 10;

// Distance of rows in time; 0 if it depends on the steps.
double row_spacing(const RunSetup& setup) {
  if (setup.rows.any()) return setup.rows.interval;
  return is_adaptive(setup.options) ? 0 : static_cast<double>(setup.every) * setup.options.step;
}

}  // namespace

Run::Run(RunSetup setup)
    : setup_(std::move(setup)),
      asked_(setup_.options),
      integrator_(setup_.subject->make_integrator(setup_.options)),
      kept_{RunRecord(*setup_.subject, setup_.start, setup_.duration, row_spacing(setup_)),
            EventWatch(setup_.events, detail::dense_output_degree(setup_.options)),
            {},
            0,
            static_cast<double>(setup_.every),
            setup_.rows.interval},
      description_(integrator_->describe()) {
  if (!setup_.chooses_method) return;
  MethodChoice choice = choose_method(setup_);
  method_reason_ = std::move(choice.reason);
  if (choice.series_tolerance > 0) go_by_series(choice.series_tolerance);
}

// Changes to Taylor series, with this tolerance of a step. 0: changes back to what was asked for.
void Run::go_by_series(double tolerance) {
  setup_.options = asked_;
  if (tolerance > 0) {
    setup_.options.method = Method::taylor;
    setup_.options.tolerance = tolerance;
  }
  setup_.motion_tolerance = tolerance > 0 ? asked_.tolerance : 0;
  kept_.series = tolerance;
  integrator_ = setup_.subject->make_integrator(setup_.options);
  description_ = integrator_->describe();
  kept_.watch.set_degree(detail::dense_output_degree(setup_.options));
}

RunReport Run::go(const std::function<bool()>& stop) {
  if (!is_aimed() || aim(stop)) return go(nullptr, stop);
  RunReport report;
  report.end = RunEnd::stopped;
  conclude(report);
  return report;
}

RunReport Run::go_on(const Checkpoint& checkpoint, const std::function<bool()>& stop) {
  const double series = kept_.series;
  become(kept_, checkpoint.record);
  if (setup_.rows.chosen) {
    setup_.every = static_cast<std::int64_t>(kept_.every);
    setup_.rows.interval = kept_.interval;
  }
  if (kept_.series != series) {
    if (!setup_.chooses_method)
      throw std::invalid_argument("checkpoint: expected one of a run whose method was asked for");
    go_by_series(kept_.series);
    method_reason_ = "as for the end that the run had before";
  }
  if (is_aimed() != (kept_.aim.tolerance > 0)) {
    throw std::invalid_argument(
        std::string("checkpoint: expected one of a run ") +
        (is_aimed() ? "with an accuracy, got one without" : "without an accuracy, got one with"));
  }
  if (is_aimed()) follow_aim();
  integrator_->resume(checkpoint.integrator);
  return go(&checkpoint, stop);
}

// Runs a trial as far as it gets, or until `stop` says so, asked after every step. The start is perturbed by the
// fraction `share`: where the errors of steps vanish, as near an equilibrium, only this shows how the motion amplifies
// errors.
Track Run::try_out(const RunOptions& options, double share, Track track,
                   const std::function<bool(const Track&)>& stop) const {
  RunSetup trial = setup_;
  trial.accuracy.error = 0;
  trial.options = options;
  trial.start.q *= 1 + share;
  trial.start.v *= 1 + share;
  trial.subject->close(trial.start);
  trial.every = std::numeric_limits<std::int64_t>::max();
  trial.rows = {};
  trial.judged = false;
  trial.chooses_method = false;
  std::erase_if(trial.events, [](const Event& event) { return !event.stop; });
  Run run(std::move(trial));
  run.track_ = std::move(track);
  run.go([&] { return stop(*run.track_); });
  return *std::move(run.track_);
}

// Returns whether the trials were not stopped.
bool Run::aim(const std::function<bool()>& stop) {
  integrator_.reset();  // frees memory: for a long chain it is as large as that of a trial; follow_aim makes a new one
  bool stopped = false;
  const auto stops = [&](const Track&) { return stopped = stopped || stop(); };
  double share = -1;
  std::optional<Track> alike;  // gives trials the times of the first one, and the fastest of the finest one so far
  const auto run_alike = [&](double tolerance) -> std::optional<Track> {
    if (stopped) return {};
    RunOptions options = setup_.options;
    options.tolerance = tolerance;
    choose_stages(options);
    Track track = try_out(options, share, alike.value_or(own_track()), stops);
    if (!track.is_complete()) return {};
    return track;
  };
  const auto run = [&](double tolerance) {
    share = std::copysign(std::max(detail::start_share * tolerance, std::numeric_limits<double>::epsilon()), -share);
    std::optional<Track> track = run_alike(tolerance);  // no two trials start alike
    if (track) alike = Track::beside(*track);
    return track;
  };
  const auto apart = [&](const Track& a, const Track& b) { return Separation(*setup_.subject, a, b); };
  const double wanted = setup_.accuracy.error;
  const detail::FinestTolerance finest = detail::finest_tolerance(setup_.options, setup_.accuracy);
  const double coarsest = setup_.subject->damped() ? 1e-3 : 1;  // rest hides earlier errors
  const double start = setup_.start.time;
  kept_.aim = detail::find_aim(wanted, coarsest, finest, start, run, run_alike, apart);
  if (!stopped && kept_.aim.finest && kept_.aim.error <= detail::close_to_wanted * wanted) {
    const std::int64_t most_steps = few_steps + times_as_many * kept_.aim.finest->steps();
    const auto is_long = [&](const Track& track) { return track.steps() > most_steps || stops(track); };
    RunOptions other = detail::of_other_kind(setup_.options, wanted);
    const auto run_other = [&](double tolerance) -> std::optional<Track> {
      other.tolerance = tolerance;
      Track track = try_out(other, std::copysign(detail::start_share * tolerance, -share), *alike, is_long);
      if (!track.is_complete()) return {};
      return track;
    };
    const double first = other.method == setup_.options.method ? kept_.aim.tolerance : detail::aimed_at * wanted;
    detail::hear_another(wanted, start, kept_.aim, first, run_other, apart);
  }
  kept_.aim.trials_end = start + setup_.duration;
  if (!stopped) follow_aim();
  return !stopped;
}

// The same number of stages for all trials and the run: errors with few and with many stages differ in size.
void Run::choose_stages(RunOptions& options) const {
  const Accuracy& accuracy = setup_.accuracy;
  if (accuracy.chooses_stages) options.stages = detail::stages_for_accuracy(options.method, accuracy.error);
}

void Run::follow_aim() {
  RunOptions& options = setup_.options;
  options.tolerance = kept_.aim.tolerance;
  choose_stages(options);
  integrator_ = setup_.subject->make_integrator(options);
  description_ = integrator_->describe();
  kept_.watch.set_degree(detail::dense_output_degree(options));
}

RunReport Run::go(const Checkpoint* from, const std::function<bool()>& stop) {
  RunReport report;
  report.stepping_seconds = std::nan("");
  const bool has_trials = from == nullptr && is_aimed() && kept_.aim.finest;
  if (setup_.is_estimated()) track_ = has_trials ? Track::at_times_of(*kept_.aim.finest) : own_track();
  integrate(from, stop, report);
  conclude(report);
  judge(report, from != nullptr, stop);
  return report;
}

void Run::conclude(RunReport& report) {
  finish(report);
  report.last = kept_.record.last();
  report.rows = rows_;
  report.options = setup_.options;
  report.method_reason = method_reason_;
  report.motion_tolerance = setup_.motion_tolerance;
  if (is_aimed()) report.aimed = kept_.aim;
  if (integrator_) {
    report.statistics = integrator_->statistics();
    description_ = integrator_->describe();
  }
  report.description = description_;
  report.energy_error = kept_.record.energy_error();
  report.energy_final = kept_.record.energy();
  report.table = kept_.record.table();
  report.events = kept_.watch.tallies();
  report.event_cost = kept_.watch.cost();
  if (track_) track_->finish(report.last, report.end == RunEnd::complete || report.end == RunEnd::event);
}

void Run::integrate(const Checkpoint* from, const std::function<bool()>& stop, RunReport& report) {
  const RunOptions& options = setup_.options;
  const Schedule schedule{longest_step(options), setup_.duration, setup_.every, setup_.rows};
  const auto on_row = [&](const Motion& motion, double work = 0) { take(motion, work); };
  const auto on_way = [&](const RowPlace& place, bool last) { come_by(place, last); };
  const auto on_step = [&] {
    const double begin = std::exchange(step_end_, integrator_->time());
    step_ = step_end_ - begin;
    if (!missed_ && detail::misses(options, integrator_->statistics().largest_defect)) missed_ = begin;
    std::optional<Motion> end = take_events(report);
    if (track_) track_->follow(*integrator_, end);
    if (!viewers_.empty()) view(end);
    return end;
  };
  integrator_->remember_steps(!setup_.events.empty() || (track_ && track_->looks()) || !viewers_.empty());
  rows_ = from == nullptr ? 0 : from->rows;
  step_end_ = from == nullptr ? setup_.start.time : from->time;
  try {
    if (from == nullptr && setup_.rows.any() && setup_.rows.at(0) != 0) look_at(setup_.start, 0);
    from == nullptr ? kept_.watch.start(setup_.start) : kept_.watch.resume(integrator_->state());
    const Motion begin = from == nullptr ? setup_.start : integrator_->state();
    if (track_) track_->begin(begin);
    for (Viewer& viewer : viewers_) viewer.begin(begin, setup_.start.time);
    const RunResult result = from == nullptr
                                 ? simulate(*integrator_, setup_.start, schedule, on_row, stop, on_way, on_step)
                                 : pendula::go_on(*integrator_, setup_.start.time, schedule,
                                                  {from->rows, from->since_row}, on_row, stop, on_way, on_step);
    if (setup_.rows.any()) look_at_end(result);
    if (step_end_ > begin.time) {
      for (Viewer& viewer : viewers_) viewer.finish(result.end ? *result.end : integrator_->state());
    }
    report.stepping_seconds = result.stepping_seconds - viewing_seconds_;
    report.step = result.outcome;
    report.end = !result.outcome  ? RunEnd::step_failed
                 : result.end     ? RunEnd::event
                 : result.stopped ? RunEnd::stopped
                                  : RunEnd::complete;
  } catch (const NotFinite&) {
    report.end = RunEnd::not_finite;
    report.step.time = integrator_->time();
  } catch (...) {
    report.end = RunEnd::observer_failed;
    report.failure = std::current_exception();
  }
}

void Run::take(const Motion& motion, double work) {
  const Observation seen = look_at(motion, work);
  ++rows_;
  if (track_ && setup_.rows.any() && !is_adaptive(setup_.options)) track_->add_row(motion);
  for (Observer* observer : takers_) observer->take({motion, seen, row_, step_});
}

// The first event that ends the run is the last one reported.
std::optional<Motion> Run::take_events(RunReport& report) {
  if (setup_.events.empty()) return {};
  const ScopedStopSign none(*integrator_, {});  // events have to be right: no interruption
  for (const Occurrence& happened : kept_.watch.after_step(*integrator_)) {
    tell(happened);
    if (!setup_.events[happened.event].stop) continue;
    report.ended_by = happened.event;
    return happened.motion;
  }
  return {};
}

void Run::tell(const Occurrence& happened) {
  const Observation seen = setup_.subject->observe(happened.motion);
  event_row_.clear();
  setup_.subject->append_row(happened.motion, seen, event_row_);
  const EventRow row{setup_.events[happened.event], happened.up, {happened.motion, seen, event_row_, step_}};
  for (Observer* observer : observers_) observer->happen(row);
}

// Runs between steps, and does not count as stepping time.
void Run::view(const std::optional<Motion>& end) {
  using Clock = std::chrono::steady_clock;
  const auto before = Clock::now();
  for (Viewer& viewer : viewers_) viewer.follow(*integrator_, end, step_);
  viewing_seconds_ += std::chrono::duration<double>(Clock::now() - before).count();
}

// The energy is not finite if anything else is not.
Observation Run::look_at(const Motion& motion, double work) {
  Observation seen = setup_.subject->observe(motion);
  if (!std::isfinite(seen.energy)) throw NotFinite();
  row_.clear();
  setup_.subject->append_row(motion, seen, row_);
  kept_.record.add(motion, seen, row_, work);
  return seen;
}

// Looks at the last state if it is not a row.
void Run::look_at_end(const RunResult& result) {
  const double time = result.end ? result.end->time : integrator_->time();
  if (time == kept_.record.last().time) return;
  Motion motion;
  double work = 0;
  if (integrator_->at_full_order(time, motion, work)) look_at(motion, work);
}

void Run::come_by(const RowPlace& place, bool last) {
  using Clock = std::chrono::steady_clock;
  if (observers_.empty()) return;
  const auto wants = [](const Observer* observer) { return observer->wants_checkpoint(); };
  if (!last && std::ranges::none_of(observers_, wants)) {
    if (std::isinf(setup_.checkpoint)) return;
    const Clock::time_point now = Clock::now();
    if (std::chrono::duration<double>(now - kept_at_).count() < setup_.checkpoint) return;
    kept_at_ = now;
  }
  const Checkpoint checkpoint{integrator_->time(), place.rows, place.since_row, integrator_->member(),
                              member_of(kept_)};
  for (Observer* observer : observers_) observer->keep(checkpoint);
}

// A run that went on has two answers: that of the trials before it, and that of a second look at what is after them.
void Run::judge(RunReport& report, bool went_on, const std::function<bool()>& stop) {
  report.warnings = event_warnings(setup_.events, report.events);
  if (!setup_.judged || (report.end != RunEnd::complete && report.end != RunEnd::event)) return;
  const auto add = [&](detail::Warning warning) {
    if (warning) report.warnings.push_back(*std::move(warning));
  };
  add(detail::of_energy(*setup_.subject, setup_.options, kept_.record.balance()));
  add(detail::of_pole(*setup_.subject, setup_.options, report));
  if (is_aimed()) {
    std::optional<Separation> parted;
    if (track_ && kept_.aim.finest) parted.emplace(*setup_.subject, *track_, *kept_.aim.finest);
    add(detail::of_aim(setup_, parted, kept_.aim, report.trust));
  }
  if (track_ && (!is_aimed() || (went_on && std::isfinite(report.trust.expected_error)))) {
    const Trust known = std::exchange(report.trust, {});
    add(look_again(report, stop));
    report.trust.until = std::min(report.trust.until, known.until);
    report.trust.expected_error = std::max(report.trust.expected_error, known.expected_error);
  }
  add(detail::of_defect(setup_, report.statistics.largest_defect, missed_, report.trust));
  add(detail::of_unseen(setup_, report.statistics, report.trust));
  if (!went_on) add(detail::of_fork(setup_, report.trust));
}

// Compares with a run that takes less time. If that says that this run cannot be trusted, compares with one that takes
// more; with constant steps only if the first comparison run diverged early.
detail::Warning Run::look_again(RunReport& report, const std::function<bool()>& stop) {
  bool stopped = false;
  integrator_.reset();
  double asked = is_adaptive(setup_.options) ? setup_.options.tolerance : 0;
  if (is_aimed()) asked = std::min(asked, setup_.accuracy.error);
  const auto compare = [&](const detail::SecondLook& look) {
    const double share =
        std::max(detail::start_share * std::min(asked, look.options.tolerance), std::numeric_limits<double>::epsilon());
    Divergence divergence(*setup_.subject, *track_);
    const Track other = try_out(look.options, share, Track::at_times_of(*track_), [&](const Track& track) {
      stopped = stopped || stop();
      return stopped || divergence.exceeds(track, detail::visible / look.trusted);
    });
    Separation parted(*setup_.subject, *track_, other);
    if (is_aimed()) parted.forget_until(kept_.aim.trials_end);  // of that the trials know more
    return parted;
  };
  std::string unknown = "it was interrupted while it ran again to see how far it can be trusted: that is not known";
  const bool ends_between =
      !setup_.subject->switches().empty() && !is_adaptive(setup_.options) && !is_explicit(setup_.options.method);
  const detail::SecondLook coarser = ends_between ? detail::by_other_stages(setup_.options)
                                                  : detail::coarser(setup_.options, report.statistics, setup_.duration);
  const Separation first = compare(coarser);
  if (stopped) return unknown;
  detail::Warning warning = detail::of_second_look(setup_, coarser, first, report.trust);
  if (!warning) return warning;
  const double begin = setup_.start.time, end = report.last.time;
  const bool is_soon = first.within(detail::visible / coarser.trusted, begin) < begin + (end - begin) / 2;
  const std::optional<detail::SecondLook> finer = detail::finer(setup_.options, setup_.duration);
  if (!finer || ends_between || !(is_adaptive(setup_.options) || is_soon)) return warning;
  const Separation second = compare(*finer);
  return stopped ? unknown : detail::of_second_look(setup_, *finer, second, report.trust);
}

// The first failure is the one reported.
void Run::finish(RunReport& report) {
  for (Observer* observer : observers_) {
    try {
      observer->finish();
    } catch (...) {
      if (report.end != RunEnd::complete && report.end != RunEnd::event && report.end != RunEnd::stopped) continue;
      report.end = RunEnd::observer_failed;
      report.failure = std::current_exception();
    }
  }
}

}  // namespace pendula
