#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <pendula/run/event_watch.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/relay.hpp>
#include <pendula/run/switching.hpp>
#include <pendula/system/system_model.hpp>
#include <stdexcept>
#include <utility>

namespace pendula {

SystemNumbers SwitchingSystem::numbers(const Sides& sides) const {
  SystemNumbers numbers = numbers_;
  double* indicator = numbers.parameters.data() + numbers.parameters.size() - 2 * switches();
  for (const int side : sides) {
    *indicator++ = side > 0 ? 1 : 0;
    *indicator++ = side > 0 ? 0 : 1;
  }
  return numbers;
}

std::vector<double> SwitchingSystem::values(const Sides& sides, const Motion& motion) const {
  SystemNumbers numbers = this->numbers(sides);
  for (const InputSine& sine : numbers.sines) {
    numbers.inputs[static_cast<std::size_t>(sine.input)] +=
        sine.amplitude * std::sin(sine.frequency * motion.time + sine.phase);
  }
  std::vector<double> found(switches());
  table_->plain.switches({table_->context, numbers.parameters.data(), &motion.time, numbers.inputs.data()},
                         motion.q.data(), motion.v.data(), found.data());
  return found;
}

SwitchingSystem::Way SwitchingSystem::way(const Motion& motion) const {
  constexpr std::size_t most_at_once = 8;
  const std::size_t count = switches();
  Sides sides(count, 1);
  std::vector<double> found;
  for (std::size_t pass = 0; pass <= count; ++pass) {  // one may depend on another
    found = values(sides, motion);
    for (std::size_t k = 0; k < count; ++k) sides[k] = found[k] < 0 ? -1 : 1;
  }
  // Those that are zero but for rounding: a moment ago or later they are of another size.
  constexpr double moment = 1e-10;
  const double soon = moment * pace(sides, motion);
  const std::vector<double> later = values(sides, ahead(sides, motion, soon));
  const std::vector<double> before = values(sides, ahead(sides, motion, -soon));
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < count; ++k) {
    const double change = std::max(std::abs(later[k] - found[k]), std::abs(before[k] - found[k]));
    if (std::abs(found[k]) <= change || found[k] == 0) open.push_back(k);
  }
  if (open.empty()) return {sides, {}};
  if (open.size() > most_at_once) open.resize(most_at_once);
  const Sides first = sides;
  std::optional<std::size_t> stuck;
  for (unsigned turned = 0; turned < 1U << open.size(); ++turned) {
    sides = first;
    for (std::size_t n = 0; n < open.size(); ++n) {
      if ((turned >> n & 1U) != 0) sides[open[n]] *= -1;
    }
    const auto leaves = [&](std::size_t k) { return drift(k, sides, motion) * sides[k] >= 0; };
    const auto back = std::ranges::find_if_not(open, leaves);
    if (back == open.end()) return {sides, {}};
    if (!stuck) stuck = *back;
  }
  return {first, stuck};
}

/// The sign that g soon changes by; 0 if it does not.
int SwitchingSystem::drift(std::size_t k, const Sides& sides, const Motion& motion) const {
  constexpr std::array<double, 7> moments{1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4};
  const double whole = pace(sides, motion), now = values(sides, motion)[k];
  for (const double moment : moments) {
    const auto change = [&](double share) {
      return values(sides, ahead(sides, motion, share * moment * whole))[k] - now;
    };
    const double half = change(0.5), all = change(1);
    // Smooth, and no mere rounding.
    if (half * all > 0 && std::abs(all) > 1.5 * std::abs(half) && std::abs(all) < 5 * std::abs(half)) {
      return sign_of(all);
    }
  }
  return 0;
}

Motion SwitchingSystem::ahead(const Sides& sides, const Motion& motion, double time) const {
  const std::vector<double> a = accelerations(sides, motion);
  const Eigen::Map<const Eigen::VectorXd> rate(a.data(), motion.v.size());
  return {motion.time + time, motion.q + time * (motion.v + time / 2 * rate), motion.v + time * rate};
}

std::vector<double> SwitchingSystem::accelerations(const Sides& sides, const Motion& motion) const {
  SystemNumbers numbers = this->numbers(sides);
  for (const InputSine& sine : numbers.sines) {
    numbers.inputs[static_cast<std::size_t>(sine.input)] +=
        sine.amplitude * std::sin(sine.frequency * motion.time + sine.phase);
  }
  std::vector<double> found(static_cast<std::size_t>(motion.v.size()));
  table_->of_1.acceleration({table_->context, numbers.parameters.data(), &motion.time, numbers.inputs.data()},
                            motion.q.data(), motion.v.data(), found.data());
  return found;
}

/// A time in which the motion changes  [s].
double SwitchingSystem::pace(const Sides& sides, const Motion& motion) const {
  const std::vector<double> a = accelerations(sides, motion);
  double force = 0;
  for (const double each : a) force = std::max(force, std::abs(each));
  const double speed = motion.v.size() > 0 ? motion.v.cwiseAbs().maxCoeff() : 0;
  return speed > 0 && force > 0 && std::isfinite(force) ? std::clamp(speed / force, 1e-3, 1e3) : 1;
}

std::vector<Sides> SwitchingSystem::all_sides() const {
  constexpr std::size_t most = 6;
  std::vector<Sides> all;
  for (unsigned turned = 0; turned < 1U << std::min(switches(), most); ++turned) {
    Sides sides(switches(), 1);
    for (std::size_t k = 0; k < sides.size(); ++k) sides[k] = (turned >> (k % most) & 1U) != 0 ? -1 : 1;
    all.push_back(std::move(sides));
  }
  return all;
}

namespace {

class SwitchingIntegrator : public Relay {
 public:
  SwitchingIntegrator(SwitchingSystem system, const RunOptions& options)
      : system_(std::move(system)),
        options_(options),
        sides_(system_.switches(), 1),
        made_for_(sides_),
        watch_(events(), detail::glance_degree(options)) {
    use(make());
  }

  Outcome start(double time, const double* q, const double* v) override {
    const Motion motion = motion_of(time, q, v);
    choose(motion);
    switchings_ = 0;
    limit_ = unlimited;
    if (sides_ != made_for_) use(make());
    watch_.start(motion, sides_);
    return begin(motion);
  }

  Outcome step(double h) override {
    forget();
    if (stuck_at_ >= 0) return stuck();
    now().remember_steps(true);
    const double begin = time();
    const Member before = now().member();
    const Motion there = now().state();
    limit_ *= 2;
    for (double most = std::min(h, limit_);; most = limit_ = (time() - begin) / 2) {
      if (time() != begin) now().resume(before);
      const Outcome stepped = now().step(most);
      if (!stepped) return finish(stepped);
      const double taken = time() - begin;
      const bool shortest = taken <= rounding_of(begin, 0) * 1e3;
      if (!shortest && !is_resolved(begin)) continue;
      const Member watched = member_of(watch_);
      const std::optional<Occurrence> first = crossing();
      if (!shortest && !is_told(begin)) {
        become(watch_, watched);
        watch_.resume(there);
        continue;
      }
      return finish(first ? cut(before, begin, time(), *first) : stepped);
    }
  }

  void remember_steps(bool wanted) override {
    Relay::remember_steps(wanted);
    now().remember_steps(true);
  }

  void member(MemberNumbers& numbers) override {
    numbers(sides_, stuck_at_, switchings_, burst_, limit_, done_, all_, watch_);
    if (sides_ != made_for_) use(make());
    own_member(numbers);
    watch_.resume(now().state());
  }

  int linearize() override { throw std::invalid_argument(pieces_have_no_derivatives); }

 private:
  std::vector<Event> events() {
    std::vector<Event> events(system_.switches());
    for (std::size_t k = 0; k < events.size(); ++k) {
      events[k].value = [this, k](const Motion& motion) { return system_.values(sides_, motion)[k]; };
    }
    return events;
  }

  std::unique_ptr<Integrator> make() {
    made_for_ = sides_;
    const SystemNumbers numbers = system_.numbers(sides_);
    return std::make_unique<Integrator>(
        library().make_system_integrator(system_.table(), numbers.plain(), options_, 0),
        static_cast<Eigen::Index>(system_.table().info.coordinates.size()), "system");
  }

  void choose(const Motion& motion) {
    SwitchingSystem::Way way = system_.way(motion);
    if (!way.stuck_at) sides_ = std::move(way.sides);
    stuck_at_ = way.stuck_at ? static_cast<int>(*way.stuck_at) : -1;
  }

  Outcome finish(const Outcome& outcome) {
    count();
    return outcome;
  }

  Outcome stuck() const {
    return {.status = Status::stuck_at_switch, .time = time(), .part = stuck_at_};
  }

  static double rounding_of(double time, double step) {
    return std::numeric_limits<double>::epsilon() * std::max(std::abs(time), std::abs(step));
  }

  /// Whether a polynomial follows each switching function through the last step: else it might come by zero unseen, as
  /// one that holds a fast sine does in the long steps of a slow motion.
  bool is_resolved(double begin) {
    constexpr double near = 0.02;                            // of the variation
    constexpr std::array<double, 4> others{0.0713, 0.2887, 0.5641, 0.8329};  // where nobody looks
    const auto glance = [&](double u) {
      return system_.values(sides_, now().glance(u == 1 ? time() : begin + u * (time() - begin)));
    };
    std::array<std::vector<double>, points> seen;
    for (std::size_t i = 0; i < points; ++i) seen[i] = glance(place(i));
    for (const double u : others) {
      const std::vector<double> found = glance(u);
      for (std::size_t k = 0; k < found.size(); ++k) {
        double above = 0, below = 0, least = seen[0][k], most = least;
        for (std::size_t i = 0; i < points; ++i) {
          const double end = i == 0 || i + 1 == points ? 0.5 : 1;
          const double weight = (i % 2 == 0 ? end : -end) / (u - place(i));
          above += weight * seen[i][k];
          below += weight;
          least = std::min(least, seen[i][k]);
          most = std::max(most, seen[i][k]);
        }
        const double rounding = 1e-13 * std::max(std::abs(least), std::abs(most));
        if (std::abs(above / below - found[k]) > near * (most - least) + rounding) return false;
      }
    }
    return true;
  }
  static double place(std::size_t i) {
    return (1 - std::cos(std::numbers::pi * static_cast<double>(i) / (points - 1))) / 2;
  }

  /// Whether the search for zeros in the last step has found out all of them.
  bool is_told(double begin) const {
    return std::ranges::none_of(watch_.tallies(), [&](const EventTally& tally) { return tally.not_told > begin; });
  }

  /// The first one in the last step.
  std::optional<Occurrence> crossing() {
    const Heeding nothing(now(), {});
    std::vector<Occurrence> found = watch_.after_step(now());
    if (found.empty()) return {};
    return std::move(found.front());
  }

  /// Takes the step again, to where a switching function is zero, and some roundings on, so that it has its new sign.
  Outcome cut(const Member& before, double begin, double end, const Occurrence& first) {
    const double at = first.motion.time;
    const double rounding = rounding_of(at, end - begin);
    double more = 0;
    Outcome stepped;
    for (int tries = 0; tries < most_tries; ++tries) {
      now().resume(before);
      const double h = std::min(at - begin + more, end - begin);
      stepped = now().step(h > 0 ? h : rounding);
      if (!stepped) return stepped;
      if (time() < std::min(at, end) - 4 * rounding) break;  // the method chose a shorter step
      if (sign_of(system_.values(sides_, now().state())[first.event]) * sides_[first.event] < 0) break;
      if (h >= end - begin) break;
      more = more == 0 ? rounding : 2 * more;
    }
    count();
    const Motion motion = now().state();
    if (time() < std::min(at, end) - 4 * rounding) {
      watch_.start(motion, sides_);
      return stepped;
    }
    choose(motion);
    watch_bursts();
    watch_.start(motion, sides_);
    if (stuck_at_ >= 0) return stepped;
    if (sides_ == made_for_) return stepped;
    const Outcome begun = hand_over(make(), motion);
    now().remember_steps(true);
    return begun ? stepped : begun;
  }

  /// Switchings that follow one another within no time never end.
  void watch_bursts() {
    constexpr int most = 100;
    constexpr double no_time = 1e-9;
    if (switchings_ % most == 0) {
      if (switchings_ > 0 && time() - burst_ <= no_time * (std::abs(time()) + longest_)) {
        stuck_at_ = std::max(stuck_at_, 0);
      }
      burst_ = time();
    }
    ++switchings_;
  }

  static constexpr int most_tries = 40;
  static constexpr double longest_ = 1e-3;  // s
  static constexpr std::size_t points = 17;
  static constexpr double unlimited = std::numeric_limits<double>::infinity();

  const SwitchingSystem system_;
  const RunOptions options_;
  Sides sides_, made_for_;
  int stuck_at_ = -1;  // a switching function that the motion cannot leave; −1: none
  std::int64_t switchings_ = 0;
  double limit_ = unlimited;  // of the next step  [s]
  double burst_ = 0;  // when the last hundred of them began
  EventWatch watch_;
};

}  // namespace

std::unique_ptr<PlainIntegrator> make_switching_integrator(const SwitchingSystem& system, const RunOptions& options) {
  return std::make_unique<SwitchingIntegrator>(system, options);
}

}  // namespace pendula
