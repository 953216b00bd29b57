#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <pendula/explicit/chain_accelerations.hpp>
#include <pendula/explicit/explicit_state.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/taylor/chain_series.hpp>
#include <pendula/taylor/series_controller.hpp>
#include <pendula/taylor/series_limits.hpp>
#include <utility>

namespace pendula {

/// Taylor series steps for one chain (the stepper of SingleIntegrator), or for several at once, one in each lane (a
/// stepper of MemberQueue). The order follows from the tolerance, the step size from the last terms of the series.
/// After each step, rods are restored to their lengths and rates are made perpendicular to them. `Rods` is
/// ChainAccelerations, with or without a tangent of each member.
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
  static constexpr bool has_tangent = State::has_tangent, is_twofold = State::is_twofold;
  using State::count;
  using Controller = SeriesController<L>;

  struct Options {
    double tolerance = 1e-9;  ///< error of a step relative to the size of the motion
  };
  explicit TaylorSteps(Subject subject, Options options = {})
      : State(subject),
        series_(dynamics_, order_for(options.tolerance)),
        trial_(parts_),
        trial_low_(parts_),
        terms_(parts_) {
    log_reach_ = std::log2(std::max(options.tolerance, detail::finest_of_series)) / series_.order();
  }

  TaylorSteps& chain() { return *this; }
  const TaylorSteps& chain() const { return *this; }

  template <class... Start>
  void start(int lane, double time, const Start&... start) {
    State::seat(lane, time, start...);
    is_expanded_ = false;
  }

  /// Visits the numbers of one motion, as MemberNumbers does.
  template <class Numbers>
  void member(Numbers& numbers) requires is_twofold {
    for (int i = 0; i < count(); ++i) {
      for (Parts* parts : {&parts_, &low_}) numbers((*parts)[i].place, (*parts)[i].rate);
    }
    is_expanded_ = false;
  }

  /// The largest steps that the series about the current states allow.
  L longest_step() {
    if (!std::exchange(is_expanded_, true)) longest_ = expand();
    return longest_;
  }

  /// Tries a step of `h` from `time` with the current series. Returns which of the `wanted` members turn by less than
  /// half a turn. The state is unchanged.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& time, const L& h, const Mask& wanted) {
    const L t = pace_ * h;
    State::arrive(
        t, [&](auto i) PENDULA_WRITTEN_OUT { return series_.rise(i, t); }, trial_, trial_low_);
    tried_ = h;
    tried_from_ = time;
    const L turned = max(dynamics_.pace_squared(trial_), State::pace_squared()) * (h * h);
    return wanted & (turned < L(State::largest_turn * State::largest_turn));
  }

  /// Moves these members to the end of the tried step.
  void accept(const Mask& which) {
    step_ = select(which, tried_, step_);
    now_ = select(which, tried_from_ + tried_, now_);
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const Part& there = State::at(trial_, i);
      State::assign(which, there, State::at(parts_, i));
      if constexpr (is_twofold) State::assign(which, State::at(trial_low_, i), State::at(low_, i));
    });
    is_expanded_ = false;
  }

  /// The end of the tried step, and the first part of it that is not finite; −1: none.
  const auto& tried() const { return trial_; }
  int part_not_finite() const requires is_twofold { return State::not_finite(trial_); }

  /// Dense output: a rod and its rate at the fraction `share` of the last accepted step.
  auto at(int i, double share) const { return series_.sum(i, L(share) * (pace_ * step_)); }

  /// Calls visit(i, ξ, ξ̇) for all rods.
  template <class Visit>
  void for_each_at(double share, Visit visit) const {
    for (int i = 0; i < count(); ++i) {
      const Part there = at(i, share);
      visit(i, detail::values_of(there.place), detail::values_of(there.rate));
    }
  }
  template <class Visit>
  void for_each_at_full_order(double share, Visit visit) const {
    for_each_at(share, visit);
  }

  /// Logarithm of the growth of these members' tangents since they had length 1; scales them to length 1 again.
  L take_growth(const Mask& which) requires has_tangent {
    const L squared = dynamics_.tangent_squared(parts_), factor = State::to_unit_length(which, squared);
    for (int i = 0; i < count(); ++i) State::scale_tangent(factor, parts_[i]);
    return 0.5 * log(squared);
  }

 private:
  using State::dynamics_;
  using State::low_;
  using State::now_;
  using State::parts_;
  using typename State::Part;
  using typename State::Parts;

  static constexpr int least_order = 6, looked_at = 4;
  static constexpr int most_units = 8;
  static constexpr double shorter_unit = 1e6;

  /// The order that needs the fewest operations for a tolerance.
  static int order_for(double tolerance) {
    const double order = 3.5 - 1.15 * std::log10(std::max(tolerance, detail::finest_of_series));
    return std::clamp(static_cast<int>(std::lround(order)), least_order, ChainSeries<Rods>::most_order);
  }

  // Computes the series about the current states. Returns the largest steps that they allow.
  //
  // A light rod between heavy ones may soon turn much faster than anything does now, which overflows the coefficients:
  // then a shorter unit of time is used.
  L expand() {
    const L found = sqrt(State::pace_squared()), now = select(found > L(0.0), found, L(1.0));
    pace_ = now;
    for (int k = 0; k < most_units; ++k) {
      series_.expand(dynamics_, parts_, pace_);
      const L step = size_by_terms(now);
      if (all(step > L(0.0))) return step;
      pace_ = select(step > L(0.0), pace_, L(shorter_unit) * pace_);
    }
    return size_by_terms(now);
  }

  // The largest steps, from the decay of the last terms, relative to the size of the motion. Several terms are used:
  // motions that start at rest, and symmetric ones, have only every second or fourth.
  PENDULA_IN_REGISTERS [[gnu::noinline]] L size_by_terms(const L& now) {
    const L pace = now * now, units = pace_ / now;
    const L moves = (units * units) * term_squared(1, pace);  // size of the motion
    const L log_size = log2_near(max(min(select(moves > L(0.0), moves, L(1.0)), L(1.0)), L(detail::almost_zero)));
    L log_radius(detail::largest_log_radius);
    for (int k = series_.order() - looked_at + 1; k <= series_.order(); ++k) {
      L squared = term_squared(k, pace);
      if constexpr (has_tangent) {
        const L tangent = dynamics_.tangent_squared(terms_) / dynamics_.tangent_squared(parts_);
        squared = max(squared, L(tangent_share * tangent_share) * tangent);
      }
      log_radius = min(log_radius, L(-0.5 / k) * (log2_near(max(squared, L(detail::almost_zero))) - log_size));
    }
    return exp(std::numbers::ln2 * min(log_radius + L(log_reach_), L(900.0))) / pace_;
  }

  // Squared coefficient of t^k, the largest over all rods and rates, relative to lengths and the pace.
  L term_squared(int k, const L& pace) {
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT { State::at(terms_, i) = series_.term(i, k); });
    return dynamics_.size_squared(terms_, pace);
  }

  ChainSeries<Rods> series_;
  double log_reach_;          // step size relative to the estimated radius of convergence, log₂
  L pace_{1.0};               // inverse of the unit of time
  L tried_{0.0}, step_{1.0};  // tried steps, last accepted steps
  L tried_from_{0.0};         // times at which these began
  L longest_{0.0};            // steps that the series allows
  bool is_expanded_ = false;  // the series is about the current states
  Parts trial_;
  [[no_unique_address]] typename State::LowParts trial_low_;
  Parts terms_;
};

}  // namespace pendula
