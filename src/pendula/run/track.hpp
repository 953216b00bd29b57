#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// States of a run along its motion: at the ends of some of its steps, or at the times of another run, to be compared
/// with that.
class Track {
 public:
  /// So many steps lie between states of a run of many. An even number, so that steps of twice the length end there,
  /// too, and a multiple of three.
  static constexpr std::int64_t apart = 6;

  /// At the end of each of the first steps, in which what is stiff dies away, and of every so many later ones, `apart`
  /// of constant ones; of a run of many steps at fewer of them.
  explicit Track(std::int64_t every) : every_(every) {}

  /// At the times of `other`.
  static Track at_times_of(const Track& other) {
    Track track(0);
    for (const Motion& state : other.states_) track.times_.push_back(state.time);
    return track;
  }

  /// Whether it goes by another's times, which takes a look into steps (Integrator::remember_steps).
  bool looks() const { return every_ == 0; }

  /// Where it begins.
  void begin(const Motion& start) {
    if (!looks()) states_.push_back(start);
  }

  /// After every step, which the run ends at `end` within, if it does.
  void follow(Integrator& integrator, const std::optional<Motion>& end) {
    if (!looks()) return count_step(integrator);
    const double last = end ? end->time : integrator.time();
    while (states_.size() < times_.size() && times_[states_.size()] <= last) {
      const double time = times_[states_.size()];
      Motion there;
      states_.push_back(integrator.look(time, there) ? std::move(there) : integrator.glance(time));
    }
  }

  /// The run is over, in this state; one that is not complete ended before its time.
  void finish(Motion last, bool is_complete) {
    last_ = std::move(last);
    is_complete_ = is_complete;
  }

  bool is_complete() const { return is_complete_; }
  const std::vector<Motion>& states() const { return states_; }
  const Motion& last() const { return last_; }

 private:
  // The first steps; states of a run of few steps, as dense as that; what is kept of any run, about 64 MB.
  static constexpr std::size_t first = 12, few = 64, most_numbers = std::size_t{1} << 23, numbers_besides = 16;

  void count_step(const Integrator& integrator) {
    ++steps_;
    if (steps_ > static_cast<std::int64_t>(first) && steps_ % every_ != 0) return;
    states_.push_back(integrator.state());
    const std::size_t numbers = 2 * static_cast<std::size_t>(states_.back().q.size()) + numbers_besides;
    if (states_.size() < (every_ < apart ? few : std::max(few, most_numbers / numbers))) return;
    std::size_t kept = first + 1;                                           // and the start
    const std::size_t next = first / static_cast<std::size_t>(every_) + 1;  // that many times `every` steps
    for (std::size_t k = kept + next % 2; k < states_.size(); k += 2) std::swap(states_[kept++], states_[k]);
    states_.resize(kept);
    every_ *= 2;
  }

  std::int64_t every_, steps_ = 0;
  std::vector<double> times_;
  std::vector<Motion> states_;
  Motion last_;
  bool is_complete_ = false;
};

/// How far two runs of one system are apart along their motion.
class Separation {
 public:
  /// Of two tracks, one of them at the times of the other, or both at those of a third.
  Separation(const Subject& subject, const Track& a, const Track& b) {
    const std::size_t common = std::min(a.states().size(), b.states().size());
    const Motion size = size_of(a, b);
    places_.reserve(common + 1);
    const auto add = [&](const Motion& one, const Motion& other) {
      const double off = subject.distance(one, other, size);
      places_.push_back({std::min(one.time, other.time), std::isnan(off) ? infinity : off});
    };
    for (std::size_t k = 0; k < common; ++k) add(a.states()[k], b.states()[k]);
    if (a.is_complete() && b.is_complete()) {
      add(a.last(), b.last());
    } else {
      places_.push_back({std::min(a.last().time, b.last().time), infinity});
    }
  }

  /// The largest distance.
  double largest() const {
    double largest = 0;
    for (const Place& place : places_) largest = std::max(largest, place.off);
    return largest;
  }

  /// The last time up to which all distances are at most so large; infinite where all are. `start` where none is.
  double within(double limit, double start) const {
    double last = start;
    for (const Place& place : places_) {
      if (!(place.off <= limit)) return last;
      last = place.time;
    }
    return infinity;
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  struct Place {
    double time, off;
  };

  // The largest of each number.
  static Motion size_of(const Track& a, const Track& b) {
    Motion size = a.last();
    size.q = size.q.cwiseAbs();
    size.v = size.v.cwiseAbs();
    const auto grow = [&](const Motion& motion) {
      size.q = size.q.cwiseMax(motion.q.cwiseAbs());
      size.v = size.v.cwiseMax(motion.v.cwiseAbs());
    };
    for (const Track* track : {&a, &b}) {
      for (const Motion& state : track->states()) grow(state);
      grow(track->last());
    }
    return size;
  }

  std::vector<Place> places_;
};

}  // namespace pendula
