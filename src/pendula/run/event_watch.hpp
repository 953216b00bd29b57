#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <pendula/run/event.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/sign_search.hpp>
#include <utility>
#include <vector>

namespace pendula {

namespace detail {

/// The states of the last step of an integrator, by the share of it that is done, 0 to 1. Those that every event
/// begins with are kept.
class StepStates {
 public:
  StepStates(Integrator& integrator, const Motion& begin, const Motion& end, EventCost& cost)
      : integrator_(integrator), begin_(begin), end_(end), cost_(cost) {}

  double time(double u) const { return begin_.time + u * (end_.time - begin_.time); }
  double length() const { return end_.time - begin_.time; }

  /// Of which a place is to be told, at best: a few roundings of the time.
  double resolution() const {
    const double latest = std::max(std::abs(begin_.time), std::abs(end_.time));
    return 2 * std::numeric_limits<double>::epsilon() * (latest / length() + 1);
  }

  /// By the step's polynomial.
  const Motion& glance(double u) {
    for (Glance& kept : kept_) {
      if (kept.u == u) return kept.motion;
      if (kept.u >= 0) continue;
      kept = {u, new_glance(u)};
      return kept.motion;
    }
    return passing_ = new_glance(u);
  }

  /// At full order; the polynomial's where the step cannot be taken.
  const Motion& look(double u) {
    if (u <= 0) return begin_;
    if (u >= 1) return end_;
    ++cost_.looks;
    if (integrator_.look(time(u), passing_)) {
      passing_.time = time(u);
    } else {
      passing_ = new_glance(u);
    }
    return passing_;
  }

 private:
  struct Glance {
    double u = -1;
    Motion motion;
  };

  Motion new_glance(double u) {
    ++cost_.glances;
    return integrator_.glance(time(u));
  }

  Integrator& integrator_;
  const Motion &begin_, &end_;
  EventCost& cost_;
  std::array<Glance, 9> kept_;
  Motion passing_;
};

/// One function of them.
class StepValues {
 public:
  StepValues(StepStates& states, const std::function<double(const Motion&)>& function)
      : states_(states), function_(function) {}

  double value(double u) { return function_(states_.glance(u)); }
  double exact_value(double u) {
    seen_ = &states_.look(u);
    return function_(*seen_);
  }

  /// The state of the last exact value.
  const Motion& seen() const { return *seen_; }

 private:
  StepStates& states_;
  const std::function<double(const Motion&)>& function_;
  const Motion* seen_ = nullptr;
};

}  // namespace detail

/// Finds the events of a run, step by step, and counts them. The motion does not depend on it.
class EventWatch {
 public:
  /// `degree` of the polynomial of a step (SignSearch).
  EventWatch(std::vector<Event> events, int degree)
      : events_(std::move(events)), tallies_(events_.size()), sides_(events_.size()), degree_(degree) {}

  const std::vector<Event>& events() const { return events_; }
  const std::vector<EventTally>& tallies() const { return tallies_; }
  const EventCost& cost() const { return cost_; }

  /// Begins where the motion does: what is zero there has not happened.
  void start(const Motion& motion) {
    motion_ = motion;
    for (std::size_t k = 0; k < events_.size(); ++k) {
      const double value = events_[k].value(motion);
      sides_[k] = {value, std::isfinite(value) ? sign_of(value) : 0};
    }
  }

  /// Goes on at `motion`, with a member of what had come there.
  void resume(const Motion& motion) { motion_ = motion; }

  /// What happened in the step that `integrator` has just taken, by time; nothing after an event that ends the run.
  std::vector<Occurrence> after_step(Integrator& integrator) {
    const Motion before = std::exchange(motion_, integrator.state());
    std::vector<Occurrence> found;
    detail::StepStates states(integrator, before, motion_, cost_);
    for (std::size_t k = 0; k < events_.size(); ++k) look_for(k, states, found);
    const auto place = [](const Occurrence& happened) { return std::pair(happened.motion.time, happened.event); };
    std::ranges::sort(found, {}, place);
    const auto ends = [&](const Occurrence& happened) { return events_[happened.event].stop; };
    const auto end = std::ranges::find_if(found, ends);
    if (end != found.end()) found.erase(end + 1, found.end());
    for (const Occurrence& happened : found) tallies_[happened.event].add(happened.motion.time);
    return found;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    for (EventTally& tally : tallies_) numbers(tally);
    for (Side& side : sides_) numbers(side.value, side.sign);
  }

 private:
  /// Where a function has come to.
  struct Side {
    double value = 0;
    int sign = 0;  // the last that was not 0; 0 where it is not known
  };

  void look_for(std::size_t k, detail::StepStates& states, std::vector<Occurrence>& found) {
    const Event& event = events_[k];
    const Side before = sides_[k];
    detail::StepValues values(states, event.value);
    SignSearch search(values, degree_);
    const double last = event.value(motion_);
    const auto search_by = [&](auto by) {
      return locate_all(k, search.find(before.value, last, before.sign, by), values, states.resolution(), found);
    };
    using By = decltype(search)::By;
    if (!search_by(By::polynomial)) search_by(By::full_order);
    const int sign = std::isfinite(last) ? sign_of(last) : 0;
    sides_[k] = {last, sign != 0 || !std::isfinite(last) ? sign : before.sign};
    if (!search.is_finite() || !std::isfinite(last)) note(tallies_[k].not_finite);
    if (!search.is_told()) note(tallies_[k].not_told);
  }

  /// Adds what happened at changes; nothing, and false, where the motion does not have one of them.
  bool locate_all(std::size_t k, const std::vector<SignChange>& changes, detail::StepValues& values, double resolution,
                  std::vector<Occurrence>& found) const {
    const std::size_t before = found.size();
    for (const SignChange& change : changes) {
      const bool up = change.sign > 0;
      if (events_[k].direction != Direction::both && (events_[k].direction == Direction::up) != up) continue;
      if (!locate(values, change, resolution)) {
        found.resize(before);
        return false;
      }
      found.push_back({k, up, values.seen()});
    }
    return true;
  }

  /// The first time that something was so.
  void note(double& time) const {
    if (std::isnan(time)) time = motion_.time;
  }

  std::vector<Event> events_;
  std::vector<EventTally> tallies_;
  std::vector<Side> sides_;
  int degree_;
  Motion motion_;  // at the end of the last step
  EventCost cost_;
};

}  // namespace pendula
