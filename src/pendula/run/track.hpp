#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <pendula/run/step_view.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// States where a motion changes fastest, because an error in time shows most there: the end of the fastest step of
/// each stretch of a run.
class FastPlaces {
 public:
  void begin(const Motion& start, std::size_t most) {
    most_ = std::max<std::size_t>(2, most);
    before_ = start;
    size_of_q_ = start.q.cwiseAbs();
    size_of_v_ = start.v.cwiseAbs();
  }

  /// Call after every step.
  void follow(const StepView& step) {
    step.read_state(now_);
    const Motion& now = now_;
    size_of_q_ = size_of_q_.cwiseMax(now.q.cwiseAbs());
    size_of_v_ = size_of_v_.cwiseMax(now.v.cwiseAbs());
    const double h = now.time - before_.time;
    const double change = std::max(largest(now.q, before_.q, size_of_q_), largest(now.v, before_.v, size_of_v_));
    const double speed = h > 0 ? change / h : 0;
    if (steps_++ % stretch_ == 0) {
      places_.push_back({now, speed});
    } else if (speed > places_.back().speed) {
      places_.back() = {now, speed};
    }
    std::swap(before_, now_);
    if (places_.size() == most_ && steps_ % stretch_ == 0) join_pairs();
  }

  std::vector<Motion> take() {
    std::vector<Motion> states;
    states.reserve(places_.size());
    for (FastPlace& place : places_) states.push_back(std::move(place.state));
    places_.clear();
    return states;
  }

 private:
  struct FastPlace {
    Motion state;
    double speed;
  };

  static double largest(const Eigen::VectorXd& now, const Eigen::VectorXd& before, const Eigen::VectorXd& size) {
    double largest = 0;
    for (Eigen::Index k = 0; k < now.size(); ++k) {
      if (size[k] > 0) largest = std::max(largest, std::abs(now[k] - before[k]) / size[k]);
    }
    return largest;
  }

  void join_pairs() {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < places_.size(); k += 2) {
      const bool second = k + 1 < places_.size() && places_[k + 1].speed > places_[k].speed;
      std::swap(places_[kept++], places_[second ? k + 1 : k]);
    }
    places_.resize(kept);
    stretch_ *= 2;
  }

  std::size_t most_ = 2;
  std::int64_t steps_ = 0, stretch_ = 1;
  Motion before_, now_;
  Eigen::VectorXd size_of_q_, size_of_v_;
  std::vector<FastPlace> places_;
};

/// States of a run along its motion, kept for comparison with another run: at the ends of some of its steps, among them
/// the fastest, or at the times of another track.
class Track {
 public:
  /// Number of steps between kept states of a long run. It is a multiple of 6, so that steps of twice or three times
  /// the length end there, too.
  static constexpr std::int64_t apart = 6;

  /// Keeps the states after each of the first steps, in which stiff components decay, and then after each `every`
  /// steps; give `apart` for constant steps. Long runs are thinned to at most `most_numbers` numbers, about 64 MB by
  /// default.
  explicit Track(std::int64_t every, std::size_t most_numbers = std::size_t{1} << 23)
      : most_numbers_(most_numbers), every_(every) {}

  /// Also keeps its own fastest places, so that they are among the times of tracks that are made of this one.
  Track&& with_fast_places() && {
    has_fast_places_ = true;
    return std::move(*this);
  }

  /// Finds states within steps by dense output, and so do tracks that are made of this one. For many motions at once
  /// full order takes too long.
  Track&& by_dense_output() && {
    is_dense_output_ = true;
    return std::move(*this);
  }

  /// A track at the times of `other`, which is finished.
  static Track at_times_of(const Track& other) {
    Track track(0);
    track.is_dense_output_ = other.is_dense_output_;
    for (const Motion& state : other.states_) track.times_.push_back(state.time);
    return track;
  }

  /// The same, with fastest places of its own. The times have the fastest places of `other`, but not those of the
  /// tracks that `other` was made of.
  static Track beside(const Track& other) {
    Track track(0);
    track.is_dense_output_ = other.is_dense_output_;
    track.common_ = other.common_;
    track.times_ = other.common_;
    track.times_.insert(track.times_.end(), other.fast_.begin(), other.fast_.end());
    std::ranges::sort(track.times_);
    track.times_.erase(std::unique(track.times_.begin(), track.times_.end()), track.times_.end());
    return std::move(track).with_fast_places();
  }

  /// Whether it uses the times of another track, which needs looks into steps (Integrator::remember_steps).
  bool looks() const { return every_ == 0; }

  /// Starts at this state.
  void begin(const Motion& start) {
    if (has_fast_places_) places_.begin(start, std::min(most_fast, most_for(start) / 2));
    if (looks()) return;
    most_ = most_for(start);
    first_ = std::min(first_, static_cast<std::int64_t>(most_ / 2));
    states_.push_back(start);
    numbers_.push_back(0);
  }

  /// Call after every step. `end` is the state at which the run ended within it, if it did.
  void follow(StepView& step, const std::optional<Motion>& end) {
    ++steps_;
    if (has_fast_places_ && !end) places_.follow(step);
    if (!looks()) return count_step(step);
    const double last = end ? end->time : step.time();
    while (states_.size() < times_.size() && times_[states_.size()] <= last) {
      const double time = times_[states_.size()];
      Motion there;
      if (is_dense_output_ || !step.at_full_order(time, there)) step.at(time, there);
      states_.push_back(std::move(there));
    }
  }

  /// Adds a row within a step: its dense output may have an error that the step has not. Very many rows are thinned.
  void add_row(const Motion& row) {
    if (looks() || ++all_rows_ % every_row_ != 0) return;
    rows_.push_back(row);
    if (rows_.size() < std::min(most_rows, most_)) return;
    auto kept = static_cast<std::size_t>(first_);
    for (std::size_t k = kept + 1; k < rows_.size(); k += 2) std::swap(rows_[kept++], rows_[k]);
    rows_.resize(kept);
    every_row_ *= 2;
  }

  /// Ends the track at this state; `is_complete` is false if the run ended early.
  void finish(Motion last, bool is_complete) {
    last_ = std::move(last);
    is_complete_ = is_complete;
    add(std::move(rows_));
    rows_.clear();
    if (common_.empty()) {
      for (const Motion& state : states_) common_.push_back(state.time);
    }
    std::vector<Motion> fast = places_.take();
    for (const Motion& state : fast) fast_.push_back(state.time);
    add(std::move(fast));
  }

  /// Steps so far.
  std::int64_t steps() const { return steps_; }

  bool is_complete() const { return is_complete_; }
  const std::vector<Motion>& states() const { return states_; }
  const Motion& last() const { return last_; }

 private:
  // Limits: of rows, of states of a run with few steps, the least of any run, of fastest places. The last counts the
  // memory of a state besides its numbers.
  static constexpr std::size_t most_rows = 256, few = 64, least = 12, most_fast = 48, numbers_besides = 24;

  std::size_t most_for(const Motion& start) const {
    return std::max(least, most_numbers_ / (2 * static_cast<std::size_t>(start.q.size()) + numbers_besides));
  }

  void add(std::vector<Motion> more) {
    if (more.empty()) return;
    std::ranges::move(more, std::back_inserter(states_));
    std::ranges::sort(states_, {}, &Motion::time);
    const auto is_same = [](const Motion& a, const Motion& b) { return a.time == b.time; };
    states_.erase(std::unique(states_.begin(), states_.end(), is_same), states_.end());
  }

  void count_step(const StepView& step) {
    if (!is_kept(steps_)) return;
    states_.push_back(step.state());
    numbers_.push_back(steps_);
    if (states_.size() < (every_ < apart ? std::min(few, most_) : most_)) return;
    every_ *= 2;
    std::size_t kept = 0;
    for (std::size_t k = 0; k < states_.size(); ++k) {
      if (!is_kept(numbers_[k])) continue;
      std::swap(states_[kept], states_[k]);
      numbers_[kept++] = numbers_[k];
    }
    states_.resize(kept);
    numbers_.resize(kept);
  }

  bool is_kept(std::int64_t step) const { return step <= first_ || step % every_ == 0; }

  std::size_t most_numbers_;
  std::int64_t every_, steps_ = 0, first_ = 12;
  std::size_t most_ = few;
  bool has_fast_places_ = false, is_dense_output_ = false;
  FastPlaces places_;
  std::vector<double> times_, common_, fast_;  // to take states at; without fastest places; of own fastest places
  std::vector<Motion> states_;
  std::vector<std::int64_t> numbers_;  // of the steps that ended at the states
  std::int64_t all_rows_ = 0, every_row_ = 1;
  std::vector<Motion> rows_;
  Motion last_;
  bool is_complete_ = false;
};

/// The largest absolute value of each number of a track.
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

/// Distances of two runs of one system along their motion.
class Separation {
 public:
  /// The distances of two tracks, at their common times.
  Separation(const Subject& subject, const Track& a, const Track& b) {
    Motion size = size_of(a);
    const Motion other_size = size_of(b);
    size.q = size.q.cwiseMax(other_size.q);
    size.v = size.v.cwiseMax(other_size.v);
    places_.reserve(std::min(a.states().size(), b.states().size()) + 1);
    const auto add = [&](const Motion& one, const Motion& other) {
      const double off = subject.distance(one, other, size);
      places_.push_back({std::min(one.time, other.time), std::isnan(off) ? infinity : off});
    };
    for (auto one = a.states().begin(), other = b.states().begin();
         one != a.states().end() && other != b.states().end();) {
      if (one->time == other->time)
        add(*one++, *other++);
      else
        ++(one->time < other->time ? one : other);
    }
    if (a.is_complete() && b.is_complete()) {
      add(a.last(), b.last());
    } else {
      places_.push_back({std::min(a.last().time, b.last().time), infinity});
    }
  }

  /// Sets the distances up to `time` to 0: they are known otherwise.
  void forget_until(double time) {
    const auto later = std::ranges::find_if(places_, [&](const DistanceAt& place) { return place.time > time; });
    for (auto place = places_.begin(); place != later; ++place) place->off = 0;
    places_.insert(later, {time, 0});
  }

  /// The largest distance.
  double largest() const {
    double largest = 0;
    for (const DistanceAt& place : places_) largest = std::max(largest, place.off);
    return largest;
  }

  /// The distance at the ends only.
  Separation of_ends() const { return Separation({places_.back()}); }

  /// The last time up to which all distances are at most `limit`; infinity if all are, `start` if none is.
  double within(double limit, double start) const {
    double last = start;
    for (const DistanceAt& place : places_) {
      if (!(place.off <= limit)) return last;
      last = place.time;
    }
    return infinity;
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  struct DistanceAt {
    double time, off;
  };

  explicit Separation(std::vector<DistanceAt> places) : places_(std::move(places)) {}

  std::vector<DistanceAt> places_;
};

/// Compares a growing track with a complete one at the same times.
class Divergence {
 public:
  /// `track` must outlive this object.
  Divergence(const Subject& subject, const Track& track) : subject_(subject), track_(track), size_(size_of(track)) {}

  /// Whether a state added since the last call is further off than `limit`. `growing` has no fastest places of its own.
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
