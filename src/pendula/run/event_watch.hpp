#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/run/event.hpp>
#include <pendula/run/step_view.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

struct SignChange;

namespace detail {

/// Degree of dense output: the stages of an implicit method, the series of taylor, else a cubic.
inline int dense_output_degree(const RunOptions& options) {
  if (options.method == Method::taylor) return 8;
  return is_explicit(options.method) ? 3 : options.stages;
}

/// Cached states of a step: those that the search for every event begins with, and the last one; and bounds of all
/// states in the step.
struct StepViews {
  struct View {
    double share = -1;
    Motion motion;
  };
  enum class Known { not_asked, yes, no };
  std::array<View, 10> kept;
  Motion passing;
  MotionRange range;
  Known range_known = Known::not_asked;

  void forget() {
    for (View& view : kept) view.share = -1;
    range_known = Known::not_asked;
  }
};

class StepStates;

}  // namespace detail

/// Finds and counts the events of a run step by step. The motion does not depend on the search.
class EventWatch {
 public:
  /// `degree` of dense output (SignSearch).
  EventWatch(std::vector<Event> events, int degree)
      : events_(std::move(events)), tallies_(events_.size()), sides_(events_.size()), degree_(degree) {}

  /// Call where the method changes.
  void set_degree(int degree) { degree_ = degree; }

  const std::vector<Event>& events() const { return events_; }
  const std::vector<EventTally>& tallies() const { return tallies_; }
  const EventCost& cost() const { return cost_; }

  /// Starts with the motion; a root at the start is no event.
  void start(const Motion& motion) {
    motion_ = motion;
    for (std::size_t k = 0; k < events_.size(); ++k) sides_[k] = side_at(events_[k], motion);
  }

  /// The same with the signs of the functions given; a value of the other sign is taken for a rounded 0.
  void start(const Motion& motion, std::span<const int> signs) {
    start(motion);
    for (std::size_t k = 0; k < events_.size(); ++k) {
      if (sides_[k].sign != signs[k]) sides_[k] = {0, signs[k]};
    }
  }

  /// Starts from an event that has happened, which is not found again.
  void start_after(const Occurrence& happened) {
    start(happened.motion);
    sides_[happened.event] = {0, happened.up ? 1 : -1};
  }

  /// Replaces the events by others with the same functions.
  void replace(std::vector<Event> events) { events_ = std::move(events); }

  /// Adds an event from the current motion on.
  void add(Event event, const Motion& motion) {
    motion_ = motion;
    sides_.push_back(side_at(event, motion));
    tallies_.emplace_back();
    events_.push_back(std::move(event));
  }

  /// Continues at `motion`, after the numbers of a member were restored.
  void resume(const Motion& motion) { motion_ = motion; }

  /// The events in a step from where the last one ended, in order of time, up to the first that ends the run.
  std::vector<Occurrence> after_step(StepView& step);

  template <class Numbers>
  void member(Numbers& numbers) {
    for (EventTally& tally : tallies_) numbers(tally);
    for (Side& side : sides_) numbers(side.value, side.sign);
  }

 private:
  /// State of an event's function at the end of the last step.
  struct Side {
    double value = 0;  // NaN where it was not asked for
    int sign = 0;      // the last nonzero sign; 0 if unknown
  };

  static Side side_at(const Event& event, const Motion& motion);
  void look_for(std::size_t k, detail::StepStates& states, std::vector<Occurrence>& found);
  bool is_excluded(std::size_t k, detail::StepStates& states);
  template <class Search, class Values>
  void look_for(std::size_t k, Search search, Values& values, double resolution, std::vector<Occurrence>& found);
  template <class Values>
  bool locate_all(std::size_t k, const std::vector<SignChange>& changes, Values& values, double resolution,
                  std::vector<Occurrence>& found) const;
  static void forget_noise(std::size_t first, double resolution, std::vector<Occurrence>& found);

  /// Keeps the first time.
  void note(double& time) const {
    if (std::isnan(time)) time = motion_.time;
  }

  std::vector<Event> events_;
  std::vector<EventTally> tallies_;
  std::vector<Side> sides_;
  int degree_;
  Motion before_, motion_;  // at both ends of the last step
  detail::StepViews views_;
  EventCost cost_;
};

}  // namespace pendula
