#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
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
    if (other.looks()) {
      track.times_ = other.times_;
    } else {
      for (const Motion& state : other.states_) track.times_.push_back(state.time);
    }
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

  /// A row within a step, which may err as the step does not. Of very many rows fewer are kept.
  void add_row(const Motion& row) {
    if (looks() || ++all_rows_ % every_row_ != 0) return;
    rows_.push_back(row);
    if (rows_.size() < at_most(most_rows)) return;
    std::size_t kept = first;
    for (std::size_t k = kept + 1; k < rows_.size(); k += 2) std::swap(rows_[kept++], rows_[k]);
    rows_.resize(kept);
    every_row_ *= 2;
  }

  /// The run is over, in this state; one that is not complete ended before its time.
  void finish(Motion last, bool is_complete) {
    last_ = std::move(last);
    is_complete_ = is_complete;
    if (rows_.empty()) return;
    std::ranges::move(rows_, std::back_inserter(states_));
    rows_.clear();
    std::ranges::stable_sort(states_, {}, &Motion::time);
    const auto same = std::ranges::unique(states_, {}, &Motion::time);
    states_.erase(same.begin(), same.end());
  }

  bool is_complete() const { return is_complete_; }
  const std::vector<Motion>& states() const { return states_; }
  const Motion& last() const { return last_; }

 private:
  // The first steps; states of a run of few steps, as dense as that; what is kept of any run, about 64 MB.
  static constexpr std::size_t first = 12, few = 64, most_numbers = std::size_t{1} << 23, numbers_besides = 16;
  static constexpr std::size_t most_rows = 256;

  /// Of what is kept, `count` or as many as there is memory for.
  std::size_t at_most(std::size_t count) const {
    const std::size_t numbers = 2 * static_cast<std::size_t>(states_.front().q.size()) + numbers_besides;
    return std::max(2 * first, std::min(count, most_numbers / numbers));
  }

  void count_step(const Integrator& integrator) {
    ++steps_;
    if (steps_ > static_cast<std::int64_t>(first) && steps_ % every_ != 0) return;
    states_.push_back(integrator.state());
    if (states_.size() < at_most(every_ < apart ? few : most_numbers)) return;
    std::size_t kept = first + 1;                                           // and the start
    const std::size_t next = first / static_cast<std::size_t>(every_) + 1;  // that many times `every` steps
    for (std::size_t k = kept + next % 2; k < states_.size(); k += 2) std::swap(states_[kept++], states_[k]);
    states_.resize(kept);
    every_ *= 2;
  }

  std::int64_t every_, steps_ = 0;
  std::vector<double> times_;
  std::vector<Motion> states_;
  std::int64_t all_rows_ = 0, every_row_ = 1;
  std::vector<Motion> rows_;
  Motion last_;
  bool is_complete_ = false;
};

/// The largest of each number of a track.
inline Motion size_of(const Track& track) {
  Motion size = track.last();
  size.q = size.q.cwiseAbs();
  size.v = size.v.cwiseAbs();
  for (const Motion& state : track.states()) {
    size.q = size.q.cwiseMax(state.q.cwiseAbs());
    size.v = size.v.cwiseMax(state.v.cwiseAbs());
  }
  return size;
}

/// How far two runs of one system are apart along their motion.
class Separation {
 public:
  /// Of two tracks, one of them at the times of the other, or both at those of a third.
  Separation(const Subject& subject, const Track& a, const Track& b) {
    const std::size_t common = std::min(a.states().size(), b.states().size());
    Motion size = size_of(a);
    const Motion other_size = size_of(b);
    size.q = size.q.cwiseMax(other_size.q);
    size.v = size.v.cwiseMax(other_size.v);
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

  std::vector<Place> places_;
};

/// Goes along with a track that grows at the times of one that is complete.
class Divergence {
 public:
  /// `track` must outlive it.
  Divergence(const Subject& subject, const Track& track) : subject_(subject), track_(track), size_(size_of(track)) {}

  /// Whether what has come since is further off than that.
  bool exceeds(const Track& growing, double limit) {
    for (; next_ < growing.states().size(); ++next_) {
      if (!(subject_.distance(track_.states()[next_], growing.states()[next_], size_) <= limit)) return true;
    }
    return false;
  }

 private:
  const Subject& subject_;
  const Track& track_;
  Motion size_;
  std::size_t next_ = 0;
};

}  // namespace pendula
