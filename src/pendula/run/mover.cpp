#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/mover.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/system/stop_sign.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {
namespace {

/// Sets a flag for a scope.
class Raised {
 public:
  explicit Raised(bool& flag) : flag_(flag) { flag_ = true; }
  ~Raised() { flag_ = false; }
  Raised(const Raised&) = delete;
  Raised& operator=(const Raised&) = delete;

 private:
  bool& flag_;
};

}  // namespace

Mover::Mover(std::shared_ptr<const Subject> subject, const RunOptions& options, bool remembers)
    : model_(std::move(subject)),
      subject_(model_),
      options_(options),
      integrator_(subject_->make_integrator(options)),
      held_{{-std::numeric_limits<double>::infinity(), inputs_of(*subject_)}},
      remembers_(remembers),
      watch_({}, detail::dense_output_degree(options)) {}

Mover::Mover(const Mover& other)
    : model_(other.model_),
      subject_(other.subject_),
      options_(other.options_),
      integrator_(subject_->make_integrator(options_)),
      held_(other.held_),
      motion_(other.motion_),
      origin_(other.origin_),
      steps_(other.steps_),
      remembers_(other.remembers_),
      history_(other.history_),
      watch_(other.watch_),
      happened_(other.happened_),
      stopped_by_(other.stopped_by_),
      stop_(other.stop_) {
  integrator_->resume(other.integrator_->member());
}

Mover::~Mover() = default;

Outcome Mover::start(const Motion& motion) {
  require_rest("restart");
  const Outcome started = integrator_->start(motion);
  if (!started) return started;
  seen_since_ = never;
  motion_ = motion;
  origin_ = motion.time;
  watch_.start(motion);
  if (remembers_) history_.add(motion);
  return started;
}

Outcome Mover::hold(std::span<const double> inputs) {
  require_rest("inputs");
  if (std::ranges::equal(inputs, this->inputs())) return {};
  std::shared_ptr<const Subject> subject = with_inputs(model_, inputs);
  std::unique_ptr<Integrator> integrator = subject->make_integrator(options_);
  const Outcome started = integrator->start(motion_);
  if (!started) return started;
  move_by(std::move(subject), std::move(integrator));
  if (!remembers_ || held_.back().since == motion_.time) held_.pop_back();
  held_.push_back({motion_.time, {inputs.begin(), inputs.end()}});
  return started;
}

void Mover::require_rest(const char* what) const {
  if (!is_advancing_) return;
  throw std::invalid_argument(std::string(what) +
                              ": expected between advances, got a call from within one (an event with stop ends it)");
}

void Mover::move_by(std::shared_ptr<const Subject> subject, std::unique_ptr<Integrator> integrator) {
  subject_ = std::move(subject);
  integrator_ = std::move(integrator);
  seen_since_ = never;
  again_.reset();
  for (Viewer& viewer : viewers_) viewer.show(*subject_);
}

const Mover::Held& Mover::held_at(double time) const {
  return *(std::ranges::upper_bound(held_, time, {}, &Held::since) - 1);
}

Advance Mover::advance_to(double time) {
  if (!(time >= motion_.time) || std::isinf(time)) {
    throw std::invalid_argument("time: expected at least " + shortest(motion_.time) + " s, which it is, got " +
                                shortest(time));
  }
  require_rest("advance");
  const Raised advancing(is_advancing_);
  Schedule schedule;
  schedule.step = longest_step(options_);
  schedule.duration = time - origin_;
  schedule.every = std::numeric_limits<std::int64_t>::max();
  stopping_.reset();
  stopped_by_.reset();
  integrator_->remember_steps(!watch_.events().empty() || !viewers_.empty());
  seen_since_ = never;
  const RunResult result = go_on(
      *integrator_, origin_, schedule, {}, [](const Motion&) {}, stop_, [](const RowPlace&, bool) {},
      [this] { return after_step(); });
  motion_ = integrator_->state();
  if (result.outcome && !result.stopped && !result.end) {  // the time from origin_ may be off by an ulp or two
    motion_.time = time;
    if (remembers_) history_.end_at(time);
  }
  stop_where_stopped();
  return {result.outcome, result.stopped, stopped_by_};
}

Advance Mover::step() {
  require_rest("step");
  const Raised advancing(is_advancing_);
  stopping_.reset();
  stopped_by_.reset();
  integrator_->remember_steps(true);
  seen_since_ = never;
  const ScopedStopSign sign(*integrator_, stop_sign(stop_));
  const double begin = integrator_->time();
  const Outcome outcome = integrator_->step(is_adaptive(options_) ? never : options_.step);
  if (outcome.status == Status::interrupted) return {.outcome = {}, .stopped = true};
  if (!outcome) return {outcome};
  after_step();
  motion_ = integrator_->state();
  seen_since_ = begin;
  stop_where_stopped();
  return {outcome, stop_(), stopped_by_};
}

void Mover::stop_where_stopped() {
  if (!stopping_) return;
  stopped_by_ = stopping_->event;
  restart_after(*std::exchange(stopping_, {}));
}

std::optional<Motion> Mover::after_step() {
  ++steps_;
  std::optional<Motion> end;
  if (!watch_.events().empty()) {
    const ScopedStopSign none(*integrator_, {});  // an interrupted search would find wrong events
    for (const Occurrence& happened : watch_.after_step(*integrator_)) {
      const std::size_t k = happened.event;
      const bool stops = happened_[k] && happened_[k](happened.up, happened.motion);
      if (!stops && !watch_.events()[k].stop) continue;
      stopping_ = happened;
      end = happened.motion;
      break;
    }
  }
  if (remembers_) history_.add(end ? *end : integrator_->state());
  for (Viewer& viewer : viewers_) viewer.follow(*integrator_, end, 0);
  return end;
}

// Restarts at an event; the rest of the step is dropped.
void Mover::restart_after(const Occurrence& happened) {
  motion_ = happened.motion;
  integrator_->start(motion_);
  seen_since_ = never;
  watch_.start_after(happened);
}

Outcome Mover::at(double time, Motion& motion) {
  if (time == motion_.time) {
    motion = motion_;
    return {};
  }
  if (time >= seen_since_ && time < motion_.time) return integrator_->at_full_order(time, motion);
  if (!history_.covers(time)) {
    throw std::invalid_argument("time: expected one since the start that steps were kept of, until " +
                                shortest(motion_.time) + " s, got " + shortest(time));
  }
  motion = history_.before(time);
  if (motion.time == time) return {};
  const Held& held = held_at(motion.time);
  if (!again_ || again_since_ != held.since) {
    again_ = with_inputs(model_, held.inputs)->make_integrator(options_);
    again_since_ = held.since;
  }
  Outcome outcome = again_->start(motion);
  const double near = 4 * std::numeric_limits<double>::epsilon() * std::abs(time);
  while (outcome && time - again_->time() > near) outcome = again_->step(time - again_->time());
  if (outcome) motion = again_->state();
  motion.time = outcome ? time : motion.time;
  return outcome;
}

void Mover::on(Event event, Happened happened) {
  if (event.formula) throw std::invalid_argument("formula: expected none, events of a simulation are functions alone");
  if (!event.value) throw std::invalid_argument("value: expected a function of the motion, got none");
  watch_.add(std::move(event), motion_);
  happened_.push_back(std::move(happened));
}

void Mover::replace(std::vector<Event> events, std::vector<Happened> happened) {
  watch_.replace(std::move(events));
  happened_ = std::move(happened);
}

void Mover::add(std::unique_ptr<Observer> observer, const RowTimes& times) {
  viewers_.emplace_back(*subject_, *observer, times).begin(motion_, motion_.time);
  observers_.push_back(std::move(observer));
}

void Mover::finish() {
  viewers_.clear();
  const std::vector<std::unique_ptr<Observer>> observers = std::exchange(observers_, {});
  for (const auto& observer : observers) observer->finish();
}

Member Mover::save() {
  Member all = member_of(*this);
  const Member steps = integrator_->member();
  all.numbers.insert(all.numbers.end(), steps.numbers.begin(), steps.numbers.end());
  return all;
}

void Mover::resume(const Member& saved) {
  const std::size_t own = member_of(*this).numbers.size(), all = own + integrator_->member().numbers.size();
  if (saved.numbers.size() != all) {
    throw std::invalid_argument("saved: expected " + std::to_string(all) +
                                " numbers of the same model and options, got " + std::to_string(saved.numbers.size()));
  }
  const auto end = saved.numbers.begin() + static_cast<std::ptrdiff_t>(own);
  const std::span held = std::span(saved.numbers).first(inputs().size());
  if (!std::ranges::equal(held, inputs())) {
    std::shared_ptr<const Subject> subject = with_inputs(model_, held);
    std::unique_ptr<Integrator> integrator = subject->make_integrator(options_);
    move_by(std::move(subject), std::move(integrator));
  }
  integrator_->resume({{end, saved.numbers.end()}});
  seen_since_ = never;
  become(*this, {{saved.numbers.begin(), end}});
  held_ = {{-std::numeric_limits<double>::infinity(), inputs()}};
  watch_.resume(motion_);
  history_.clear();
  if (remembers_) history_.add(motion_);
}

}  // namespace pendula
