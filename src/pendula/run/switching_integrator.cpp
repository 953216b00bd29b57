#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <pendula/numeric/interval.hpp>
#include <pendula/numeric/sampled_polynomial.hpp>
#include <pendula/run/event_location.hpp>
#include <pendula/run/event_watch.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/relay.hpp>
#include <pendula/run/switching.hpp>
#include <pendula/system/field_look.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

namespace pendula {

namespace {

/// Tells whether a motion switches ever faster and ever closer to its switching points, without end. A preloaded detent
/// with a viscous damper does: its n-th swing takes 1/n as long and gets 1/n² as far. Switchings are counted in blocks,
/// each as many as all before it.
class PileUp {
 public:
  void begin(double time, std::size_t functions) {
    count_ = 0;
    begin_ = time;
    lasted_ = 0;
    whole_.assign(functions, 0);
    here_ = before_ = whole_;
  }

  /// Values of the switching functions between two switchings.
  void reach(const std::vector<double>& values) {
    for (std::size_t k = 0; k < values.size(); ++k) {
      here_[k] = std::max(here_[k], std::abs(values[k]));
      whole_[k] = std::max(whole_[k], here_[k]);
    }
  }

  /// Counts a switching by function `k`. Returns whether they will not end.
  bool count(double time, std::size_t k) {
    constexpr std::int64_t first = 256;
    constexpr double as_long = 1.2, nearer = 0.5, close = 1e-6;
    if (++count_ < first || (count_ & (count_ - 1)) != 0) return false;
    const double lasts = time - begin_;
    const bool is_endless = count_ >= 4 * first && lasts <= as_long * lasted_ && here_[k] <= nearer * before_[k] &&
                            here_[k] <= close * whole_[k];
    begin_ = time;
    lasted_ = lasts;
    before_ = here_;
    std::fill(here_.begin(), here_.end(), 0);
    return is_endless;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(count_, begin_, lasted_, whole_, here_, before_);
  }

 private:
  std::int64_t count_ = 0;
  double begin_ = 0, lasted_ = 0;  // of this block  [s]; the one before  [s]
  std::vector<double> whole_, here_,
      before_;  // how far functions get from zero: ever; in this block; in the one before
};

constexpr const char* pieces_have_no_derivatives =
    "derivatives: expected a model whose functions are of one piece, got one that switches between pieces: derivatives "
    "of its motion jump there, and are not told";

class SwitchingIntegrator : public Relay {
 public:
  SwitchingIntegrator(SwitchingSystem system, const RunOptions& options)
      : system_(std::move(system)),
        options_(options),
        sides_(system_.switches(), 1),
        made_for_(sides_),
        watch_(events(), detail::dense_output_degree(options)) {
    pile_.begin(0, system_.switches());
    use(make());
  }

  Outcome start(double time, const double* q, const double* v) override {
    const Motion motion = motion_of(time, q, v);
    choose(motion);
    switchings_ = 0;
    pile_.begin(time, system_.switches());
    is_of_end_ = false;
    limit_ = first_limit(motion);
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
    for (double most = std::min(h, limit_);; most = shorter * (time() - begin)) {
      if (time() != begin) now().resume(before);
      const Outcome stepped = now().step(most);
      if (!stepped) return finish(stepped);
      const double taken = time() - begin;
      const bool shortest = taken <= rounding_of(begin, 0) * 1e3;
      if (!shortest && !(is_resolved(begin) && is_slow(begin))) continue;
      const Member watched = member_of(watch_);
      const std::optional<Occurrence> first = crossing();
      if (!shortest && !is_told(begin)) {
        become(watch_, watched);
        watch_.resume(there);
        continue;
      }
      limit_ = is_adaptive(options_) || most < h ? growth * taken : unlimited;
      // A zero is known to rounding, and rounding depends on the step: so does the state from here on.
      const std::optional<std::size_t> zero = first ? std::nullopt : zero_at_end();
      if ((first || zero) && is_adaptive(options_) && taken >= h * (1 - 1e-9)) is_of_end_ = true;
      if (first) return finish(cut(before, begin, time(), *first));
      see_reach(begin);
      return zero ? go_on(stepped, *zero) : finish(stepped);
    }
  }

  bool depends_on_end(double h) const override { return is_of_end_ || (is_adaptive(options_) && h <= limit_); }

  void remember_steps(bool wanted) override {
    Relay::remember_steps(wanted);
    now().remember_steps(true);
  }

  void member(MemberNumbers& numbers) override {
    numbers(sides_, stuck_at_, switchings_, burst_, pile_, limit_, is_of_end_, done_, all_, watch_);
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
        library<SystemMaker>().make_integrator(system_.table(), numbers.plain(), options_, 0),
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

  Outcome stuck() const { return {.status = Status::stuck_at_switch, .time = time(), .part = stuck_at_}; }

  /// The first limit of adaptive steps. It grows from step to step, and does not depend on where the run ends.
  double first_limit(const Motion& motion) const {
    return is_adaptive(options_) ? 4 * system_.pace(sides_, motion) : unlimited;
  }

  static double rounding_of(double time, double step) {
    return std::numeric_limits<double>::epsilon() * std::max(std::abs(time), std::abs(step));
  }

  /// Whether a polynomial follows each switching function through the last step. Otherwise a function may cross zero
  /// unseen: one that holds a fast sine may do so in the long steps of a slow motion.
  bool is_resolved(double begin) {
    constexpr double near = 0.02;                                            // of the variation
    constexpr std::array<double, 4> others{0.0713, 0.2887, 0.5641, 0.8329};  // apart from the nodes
    const auto values_at = [&](double u) {
      return system_.values(sides_, now().at(u == 1 ? time() : begin + u * (time() - begin)));
    };
    std::array<std::vector<double>, points> seen;
    for (std::size_t i = 0; i < points; ++i) seen[i] = values_at(place(i));
    for (const double u : others) {
      const std::vector<double> found = values_at(u);
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

  /// Whether the arguments of functions such as exp and tanh change little in the last step. Otherwise a narrow change
  /// of a switching function might lie between all samples.
  bool is_slow(double begin) {
    constexpr double little = 8;
    std::array<std::vector<double>, BernsteinPolynomial::size> seen;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const double u = sample_place(i);
      seen[i] = system_.fast_arguments(sides_, now().at(u == 1 ? time() : begin + u * (time() - begin)));
    }
    for (std::size_t k = 0; k < seen[0].size(); ++k) {
      BernsteinPolynomial::Numbers values;
      for (std::size_t i = 0; i < seen.size(); ++i) values[i] = seen[i][k];
      const Interval range = BernsteinPolynomial::through(values).range();
      if (range.low < detail::negligible_exponent && range.high > -detail::negligible_exponent &&
          range.high - range.low > little)
        return false;
    }
    return true;
  }
  static double place(std::size_t i) {
    return (1 - std::cos(std::numbers::pi * static_cast<double>(i) / (points - 1))) / 2;
  }

  /// Whether the search for zeros in the last step resolved the switching functions.
  bool is_told(double begin) const {
    return std::ranges::none_of(watch_.tallies(), [&](const EventTally& tally) { return tally.not_told > begin; });
  }

  /// The first zero in the last step.
  std::optional<Occurrence> crossing() {
    const ScopedStopSign none(now(), {});
    std::vector<Occurrence> found = watch_.after_step(now());
    if (found.empty()) return {};
    return std::move(found.front());
  }

  /// The switching function that is zero where the last step ended, if one is.
  std::optional<std::size_t> zero_at_end() const {
    const std::vector<double> values = system_.values(sides_, now().state());
    const auto zero = std::ranges::find(values, 0.0);
    if (zero == values.end()) return {};
    return static_cast<std::size_t>(zero - values.begin());
  }

  /// Tells pile_ the switching functions half way through the last step.
  void see_reach(double begin) { pile_.reach(system_.values(sides_, now().at((begin + time()) / 2))); }

  /// Takes the step again, to the zero of a switching function, and a few roundings on, until it has its new sign.
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
    see_reach(begin);
    if (time() >= std::min(at, end) - 4 * rounding) return go_on(stepped, first.event);
    watch_.start(now().state(), sides_);
    return stepped;
  }

  /// Goes on after a step to a zero, on the sides that the motion takes from there.
  Outcome go_on(const Outcome& stepped, std::size_t switched) {
    count();
    const Motion motion = now().state();
    choose(motion);
    if (stuck_at_ < 0 && is_endless(switched)) stuck_at_ = static_cast<int>(switched);
    watch_.start(motion, sides_);
    if (stuck_at_ >= 0) return stepped;
    if (sides_ == made_for_) return stepped;
    limit_ = first_limit(motion);
    const Outcome begun = hand_over(make(), motion);
    now().remember_steps(true);
    return begun ? stepped : begun;
  }

  /// Whether switchings, the last one by this function, follow one another within no time, or pile up.
  bool is_endless(std::size_t switched) {
    constexpr int most = 100;
    constexpr double no_time = 1e-9;
    bool is_burst = false;
    if (switchings_ % most == 0) {
      is_burst = switchings_ > 0 && time() - burst_ <= no_time * (std::abs(time()) + longest_);
      burst_ = time();
    }
    ++switchings_;
    return pile_.count(time(), switched) || is_burst;
  }

  static constexpr int most_tries = 40;
  static constexpr double growth = 8;       // of chosen steps, from one to the next
  static constexpr double shorter = 0.4;    // not 0.5: runs with steps twice as long would take the same ones
  static constexpr double longest_ = 1e-3;  // s
  static constexpr std::size_t points = 17;
  static constexpr double unlimited = std::numeric_limits<double>::infinity();

  const SwitchingSystem system_;
  const RunOptions options_;
  Sides sides_, made_for_;
  int stuck_at_ = -1;  // a switching function that the motion cannot leave; −1: none
  std::int64_t switchings_ = 0;
  double limit_ = unlimited;  // of the next step  [s]
  bool is_of_end_ = false;    // whether the end of the run has affected the state
  double burst_ = 0;          // when the last hundred switchings began  [s]
  PileUp pile_;
  EventWatch watch_;
};

}  // namespace

std::unique_ptr<PlainIntegrator> make_switching_integrator(SwitchingSystem system, const RunOptions& options) {
  return std::make_unique<SwitchingIntegrator>(std::move(system), options);
}

}  // namespace pendula
