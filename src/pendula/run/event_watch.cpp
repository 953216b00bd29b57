#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <pendula/run/event_location.hpp>
#include <pendula/run/event_watch.hpp>
#include <pendula/run/formula_search.hpp>
#include <utility>

namespace pendula {

namespace detail {

/// States within a step by the fraction of it that is done.
class StepStates {
 public:
  StepStates(StepView& step, const Motion& begin, const Motion& end, StepViews& views, EventCost& cost)
      : step_(step), begin_(begin), end_(end), views_(views), cost_(cost) {
    views.forget();
  }

  double time(double u) const { return u == 1 ? end_.time : begin_.time + u * (end_.time - begin_.time); }
  double length() const { return end_.time - begin_.time; }

  /// Smallest meaningful fraction of the step: a few roundings of the time.
  double resolution() const {
    const double latest = std::max(std::abs(begin_.time), std::abs(end_.time));
    return 2 * std::numeric_limits<double>::epsilon() * (latest / length() + 1);
  }

  /// Bounds of all states of the step; null where they are not known.
  const MotionRange* range() {
    if (views_.range_known == StepViews::Known::not_asked) {
      views_.range_known = find_range(views_.range) ? StepViews::Known::yes : StepViews::Known::no;
    }
    return views_.range_known == StepViews::Known::yes ? &views_.range : nullptr;
  }

  /// The state by dense output.
  const Motion& at(double u) {
    for (StepViews::View& view : views_.kept) {
      if (view.share == u) return view.motion;
      if (view.share >= 0) continue;
      view.share = u;
      return new_state(u, view.motion);
    }
    return new_state(u, views_.passing);
  }

  /// The state at full order; by dense output if the step fails.
  const Motion& at_full_order(double u) {
    if (u <= 0) return begin_;
    if (u >= 1) return end_;
    ++cost_.looks;
    if (!step_.at_full_order(time(u), views_.passing)) return new_state(u, views_.passing);
    views_.passing.time = time(u);
    return views_.passing;
  }

 private:
  bool find_range(MotionRange& range) {
    range.least = begin_;
    range.most = end_;
    if (!step_.bound_excursions(range.most)) return false;
    // The polynomial through the stages does not show what is damped between the start and the first stage.
    range.most.v += (at(0).v - begin_.v).cwiseAbs();
    // Rates that are computed from momenta have rounding errors as large as those of the largest rate.
    const auto lay_around = [](const auto& begin, const auto& end, auto& least, auto& most) {
      constexpr double rounding = 8 * std::numeric_limits<double>::epsilon();
      most.array() += rounding * (most.array() + begin.cwiseAbs().maxCoeff());
      least -= most;
      most += begin;
      return (least.array() <= end.array()).all() && (end.array() <= most.array()).all();
    };
    return lay_around(begin_.q, end_.q, range.least.q, range.most.q) &&
           lay_around(begin_.v, end_.v, range.least.v, range.most.v);
  }

  const Motion& new_state(double u, Motion& motion) {
    ++cost_.glances;
    step_.at(u, time(u), motion);
    return motion;
  }

  StepView& step_;
  const Motion &begin_, &end_;
  StepViews& views_;
  EventCost& cost_;
};

/// Values of one event function within a step.
class StepValues {
 public:
  StepValues(StepStates& states, const std::function<double(const Motion&)>& function)
      : states_(states), function_(function) {}

  double value(double u) { return function_(states_.at(u)); }
  double exact_value(double u) {
    seen_ = &states_.at_full_order(u);
    return function_(*seen_);
  }

  /// The state of the last exact value.
  const Motion& seen() const { return *seen_; }

 private:
  StepStates& states_;
  const std::function<double(const Motion&)>& function_;
  const Motion* seen_ = nullptr;
};

/// Values of an event formula within a step. A formula of time alone needs no states except where something happens.
class FormulaValues {
 public:
  FormulaValues(StepStates& states, Formula& formula) : states_(states), formula_(formula), numbers_(formula.size()) {}

  std::size_t size() const { return formula_.size(); }
  double time(double u) const { return states_.time(u); }
  double resolution() const { return states_.resolution(); }
  void at(double u, std::span<double> numbers) { formula_.read(states_.at(u), numbers); }
  void at_full_order(double u, std::span<double> numbers) { formula_.read(states_.at_full_order(u), numbers); }
  double value(double time, std::span<const double> numbers) { return formula_.value(time, numbers); }
  Reach reach(const Reach& time, std::span<const Reach> numbers) { return formula_.reach(time, numbers); }

  double exact_value(double u) {
    place_ = u;
    if (size() > 0) {
      seen_ = &states_.at_full_order(u);
      formula_.read(*seen_, numbers_);
    }
    return value(time(u), numbers_);
  }

  /// The state of the last exact value.
  const Motion& seen() { return size() > 0 ? *seen_ : states_.at_full_order(place_); }

 private:
  StepStates& states_;
  Formula& formula_;
  std::vector<double> numbers_;
  double place_ = 0;
  const Motion* seen_ = nullptr;
};

}  // namespace detail

EventWatch::Side EventWatch::side_at(const Event& event, const Motion& motion) {
  const double value = event.value(motion);
  return {value, std::isfinite(value) ? sign_of(value) : 0};
}

std::vector<Occurrence> EventWatch::after_step(StepView& step) {
  std::swap(before_, motion_);
  step.read_state(motion_);
  std::vector<Occurrence> found;
  detail::StepStates states(step, before_, motion_, views_, cost_);
  for (std::size_t k = 0; k < events_.size(); ++k) look_for(k, states, found);
  const auto place = [](const Occurrence& happened) { return std::pair(happened.motion.time, happened.event); };
  std::ranges::sort(found, {}, place);
  const auto ends = [&](const Occurrence& happened) { return events_[happened.event].stop; };
  const auto end = std::ranges::find_if(found, ends);
  if (end != found.end()) found.erase(end + 1, found.end());
  for (const Occurrence& happened : found) tallies_[happened.event].add(happened.motion.time);
  return found;
}

void EventWatch::look_for(std::size_t k, detail::StepStates& states, std::vector<Occurrence>& found) {
  if (is_excluded(k, states)) return;
  if (events_[k].formula == nullptr) {
    detail::StepValues values(states, events_[k].value);
    look_for(k, SignSearch(values, degree_), values, states.resolution(), found);
  } else {
    detail::FormulaValues values(states, *events_[k].formula);
    look_for(k, FormulaSearch(values, degree_), values, states.resolution(), found);
  }
}

// Whether bounds of the states show that the function keeps its sign in the step.
bool EventWatch::is_excluded(std::size_t k, detail::StepStates& states) {
  constexpr int coarse = 2;  // polynomials of such a degree bound too little to be worth the question
  if (!events_[k].enclose || sides_[k].sign == 0 || degree_ <= coarse) return false;
  if (events_[k].formula != nullptr && events_[k].formula->size() == 0) return false;  // of time alone
  const MotionRange* const range = states.range();
  if (range == nullptr || events_[k].enclose(*range).side() != sides_[k].sign) return false;
  sides_[k].value = std::numeric_limits<double>::quiet_NaN();
  return true;
}

template <class Search, class Values>
void EventWatch::look_for(std::size_t k, Search search, Values& values, double resolution,
                          std::vector<Occurrence>& found) {
  Side before = sides_[k];
  if (std::isnan(before.value)) before.value = events_[k].value(before_);
  const double last = events_[k].value(motion_);
  const int sign = std::isfinite(last) ? sign_of(last) : 0;
  const auto search_by = [&](SeenBy by) {
    const std::vector<SignChange> changes = search.find(before.value, last, before.sign, by);
    return search.is_told() && locate_all(k, changes, values, resolution, found);
  };
  // States at full order are expensive: after one failure they are not used again for this function.
  const bool may_tell = std::isnan(tallies_[k].not_told);
  const bool is_found =
      search_by(SeenBy::polynomial) || ((search.is_told() || may_tell) && search_by(SeenBy::full_order));
  if (!is_found) locate_all(k, changes_by_ends(before.sign, sign), values, resolution, found);
  sides_[k] = {last, sign != 0 || !std::isfinite(last) ? sign : before.sign};
  if (!search.is_finite() || !std::isfinite(last)) note(tallies_[k].not_finite);
  if (!is_found) note(tallies_[k].not_told);
}

// Adds the occurrences at these changes; adds nothing and returns false if the motion lacks one of them.
template <class Values>
bool EventWatch::locate_all(std::size_t k, const std::vector<SignChange>& changes, Values& values, double resolution,
                            std::vector<Occurrence>& found) const {
  const std::size_t before = found.size();
  for (std::size_t n = 0; n < changes.size(); ++n) {
    const SignChange& change = changes[n];
    const bool up = change.sign > 0;
    if (events_[k].direction != Direction::both && (events_[k].direction == Direction::up) != up) continue;
    // Where a pair is close to a double zero, the sign of the place between may be a rounding error.
    const double low = n == 0 ? 0 : changes[n - 1].from, high = n + 1 == changes.size() ? 1 : changes[n + 1].to;
    if (!locate(values, change, resolution) && !locate_beside(values, change, low, high, resolution)) {
      found.resize(before);
      return false;
    }
    found.push_back({k, up, values.seen()});
  }
  forget_noise(before, resolution * std::abs(motion_.time - before_.time), found);
  return true;
}

// Near a root, rounded states may cross zero several times within their rounding. Two crossings in opposite
// directions cancel, two in the same direction count once.
void EventWatch::forget_noise(std::size_t first, double resolution, std::vector<Occurrence>& found) {
  constexpr double most_noise = 16;  // between instants, in resolutions; 3.4 were observed
  for (std::size_t n = first; n + 1 < found.size();) {
    if (found[n + 1].motion.time - found[n].motion.time > most_noise * resolution) {
      ++n;
      continue;
    }
    const bool is_back = found[n + 1].up != found[n].up;
    const auto at = found.begin() + static_cast<std::ptrdiff_t>(n);
    found.erase(is_back ? at : at + 1, at + 2);
    if (is_back && n > first) --n;
  }
}

}  // namespace pendula
