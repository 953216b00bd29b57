#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/explicit/chain_accelerations.hpp>
#include <pendula/explicit/explicit_state.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/taylor/chain_series.hpp>

namespace pendula {

/// Chooses the steps of every member by the series that it is to be moved by.
template <class L>
class SeriesController {
 public:
  using Mask = typename L::Mask;

  explicit SeriesController(double /*tolerance*/) {}

  template <class Stepper>
  void start(const Mask& which, Stepper& /*stepper*/) {
    longest_ = select(which, L(unlimited), longest_);
  }

  /// Of the next step, unless the run ends before.
  template <class Stepper>
  L step(Stepper& stepper) {
    return min(longest_, stepper.expand());
  }

  template <class Stepper>
  Mask accepts(const Mask& which, const L& /*h*/, Stepper& /*stepper*/) const {
    return which;
  }

  /// The next step of these members is to be `factor` of one that failed.
  void shrink(const Mask& which, const L& h, const L& factor) { longest_ = select(which, factor * h, longest_); }

  template <class Stepper>
  void move_on(const Mask& which, const L& /*h*/, Stepper& /*stepper*/) {
    longest_ = select(which, L(unlimited), longest_);
  }

 private:
  static constexpr double unlimited = 1e300;

  L longest_{unlimited};
};

/// Steps of Taylor series on several chains at once, one in each lane: as a stepper of MemberQueue. The order follows
/// from the tolerance; a step is as long as the last terms of its series allow. After each step rods have their lengths
/// again, and rates go across. `Rods` is ChainAccelerations, with a tangent of each member or without.
template <class Rods>
class TaylorSteps : public ExplicitState<Rods> {
  using State = ExplicitState<Rods>;

 public:
  static constexpr int stages = 1;
  static constexpr bool can_choose = true;
  using Chain = TaylorSteps;
  using Subject = typename Rods::Subject;
  using typename State::L;
  using typename State::Mask;
  static constexpr bool has_tangent = State::has_tangent;
  using State::links;
  using Controller = SeriesController<L>;

  struct Options {
    double tolerance = 1e-9;  ///< of a step's error, relative to the size of the motion
  };
  explicit TaylorSteps(Subject subject, Options options = {})
      : State(subject), series_(dynamics_, order_for(options.tolerance)), trial_(parts_), terms_(parts_) {
    log_reach_ = std::log(std::max(options.tolerance, finest)) / series_.order();
  }

  TaylorSteps& chain() { return *this; }
  const TaylorSteps& chain() const { return *this; }

  template <class... Start>
  void start(int lane, double time, const Start&... start) {
    State::seat(lane, time, start...);
  }

  /// The series about where all are, and how long steps may be by them.
  ///
  /// Where a light rod is between heavy ones it soon turns much faster than all do now: then in a shorter unit of time.
  L expand() {
    const L found = sqrt(State::pace_squared()), now = select(found > L(0.0), found, L(1.0));
    pace_ = now;
    for (int k = 0; k < most_units; ++k) {
      series_.expand(dynamics_, parts_, pace_);
      const L step = longest_step(now);
      if (xsimd::all(step > L(0.0))) return step;
      pace_ = select(step > L(0.0), pace_, L(shorter_unit) * pace_);
    }
    return longest_step(now);
  }

  /// Tries a step of `h` from `time`, by the series about there; gives those of the members that are `wanted` who turn
  /// by less than half a turn. The state stays what it was.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& time, const L& h, const Mask& wanted) {
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT { State::at(trial_, i) = series_.sum(i, pace_ * h); });
    dynamics_.restore(trial_);
    tried_ = h;
    tried_from_ = time;
    const L turned = max(dynamics_.pace_squared(trial_), State::pace_squared()) * (h * h);
    return wanted & (turned < L(State::largest_turn * State::largest_turn));
  }

  /// Moves the members to the end of the step that was tried.
  void accept(const Mask& which) {
    step_ = select(which, tried_, step_);
    now_ = select(which, tried_from_ + tried_, now_);
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const Part& there = State::at(trial_, i);
      State::assign(which, there, State::at(parts_, i));
    });
  }

  /// A rod and its rate, of the members whose step was accepted, when `share` of it was done.
  auto glance(int i, double share) const { return series_.sum(i, L(share) * (pace_ * step_)); }

  /// Of all rods; visit(i, ξ, ξ̇).
  template <class Visit>
  void for_each_glance(double share, Visit visit) const {
    for (int i = 0; i < links(); ++i) {
      const Part there = glance(i, share);
      visit(i, detail::values_of(there.place), detail::values_of(there.rate));
    }
  }
  template <class Visit>
  void for_each_look(double share, Visit visit) const {
    for_each_glance(share, visit);
  }

  /// The logarithm of how long the tangents of these members have grown since they had the length 1, which they have
  /// again after this.
  L take_growth(const Mask& which) requires has_tangent {
    const L squared = dynamics_.tangent_squared(parts_), factor = State::to_unit_length(which, squared);
    for (int i = 0; i < links(); ++i) State::scale_tangent(factor, parts_[i]);
    return 0.5 * log(squared);
  }

 private:
  using State::dynamics_;
  using State::now_;
  using State::parts_;
  using typename State::Part;
  using typename State::Parts;

  static constexpr double finest = 1e-17, tiny = 1e-300;
  static constexpr int least_order = 6, looked_at = 4;
  static constexpr int most_units = 8;
  static constexpr double shorter_unit = 1e6;

  /// Of the fewest operations for a tolerance.
  static int order_for(double tolerance) {
    const double order = 3.5 - 1.15 * std::log10(std::max(tolerance, finest));
    return std::clamp(static_cast<int>(std::lround(order)), least_order, ChainSeries<Rods>::most_order);
  }

  // The last terms shrink as the series does, beside the size of the motion. Those that begin at rest, and symmetric
  // ones, have but every second or fourth.
  PENDULA_IN_REGISTERS [[gnu::noinline]] L longest_step(const L& now) {
    const L pace = now * now, units = pace_ / now;
    const L moves = (units * units) * term_squared(1, pace);  // where it is, or will be
    const L log_size = log(min(select(moves > L(0.0), moves, L(1.0)), L(1.0)));
    L log_radius(1e3);
    for (int k = series_.order() - looked_at + 1; k <= series_.order(); ++k) {
      L squared = term_squared(k, pace);
      if constexpr (has_tangent) {
        const L tangent = dynamics_.tangent_squared(terms_) / dynamics_.tangent_squared(parts_);
        squared = max(squared, L(tangent_share * tangent_share) * tangent);
      }
      log_radius = min(log_radius, L(-0.5 / k) * (log(max(squared, L(tiny))) - log_size));
    }
    return exp(min(log_radius + L(log_reach_), L(600.0))) / pace_;
  }

  // Of the coefficient of t^k in all rods and rates, relative to lengths and the pace.
  L term_squared(int k, const L& pace) {
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT { State::at(terms_, i) = series_.term(i, k); });
    return dynamics_.size_squared(terms_, pace);
  }

  ChainSeries<Rods> series_;
  double log_reach_;          // of steps, relative to the radius that terms tell
  L pace_{1.0};               // in which time is counted
  L tried_{0.0}, step_{1.0};  // the steps that were tried, and those that were taken last
  L tried_from_{0.0};         // when they began
  Parts trial_, terms_;
};

}  // namespace pendula
