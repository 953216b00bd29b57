#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <pendula/explicit/chain_accelerations.hpp>
#include <pendula/explicit/error_controller.hpp>
#include <pendula/explicit/explicit_state.hpp>
#include <pendula/explicit/explicit_tableau.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/moving_part.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// An explicit Runge–Kutta method for one motion, or for several members at once, one in each lane; for moderate
/// accuracy and short times. After each step, rods are restored to their lengths and rates are made perpendicular to
/// them. `Dynamics` is ChainAccelerations or SystemAccelerations, with or without a tangent of each member.
template <class Dynamics, class Method>
class ExplicitSteps : public ExplicitState<Dynamics> {
  using State = ExplicitState<Dynamics>;
  using typename State::LowParts;
  using typename State::Number;
  using typename State::Part;
  using typename State::Parts;

 public:
  static constexpr int stages = static_cast<int>(Method::stages);
  static constexpr bool can_choose = Method::error_order > 0;
  /// Nodes of a Gauss quadrature as accurate as the method.
  static constexpr int nodes = (Method::error_order + 2) / 2;
  using Chain = ExplicitSteps;
  using Subject = typename Dynamics::Subject;
  using typename State::L;
  using typename State::Mask;
  using typename State::Vector;
  static constexpr std::size_t D = State::D;
  static constexpr bool has_tangent = State::has_tangent, is_twofold = State::is_twofold;
  using State::count;
  using Controller = ErrorController<L, Method::error_order>;

  struct Options {};
  explicit ExplicitSteps(Subject subject, Options = {})
      : State(subject),
        slopes_(parts_),
        trial_(parts_, low_),
        before_(trial_),
        stages_(parts_),
        inner_slopes_(Method::stages - 1, parts_),
        errors_(dynamics_.parts()) {
    for (int i = 0; i < dynamics_.parts(); ++i) {
      for (Parts& slopes : inner_slopes_) slopes[i] = Part::zero();
      for (Parts* slopes : {&slopes_, &trial_.slopes, &before_.slopes}) (*slopes)[i] = Part::zero();
    }
  }

  ExplicitSteps& chain() { return *this; }
  const ExplicitSteps& chain() const { return *this; }

  /// The state of the members, with everything that their next steps depend on.
  struct FullState {
    FullState(Parts where, LowParts rest) : parts(std::move(where)), slopes(parts), low(std::move(rest)) {}

    Parts parts, slopes;
    [[no_unique_address]] LowParts low;
  };
  FullState place() const {
    FullState here(parts_, low_);
    here.slopes = slopes_;
    return here;
  }
  void go_to(const FullState& place) {
    parts_ = place.parts;
    slopes_ = place.slopes;
    low_ = place.low;
  }

  /// Starts a member in a lane: ChainAccelerations::start.
  template <class... Start>
  void start(int lane, double time, const Start&... start) {
    State::seat(lane, time, start...);
    set(fresh_, lane, 1);
  }

  /// Visits the numbers of one motion, as MemberNumbers does.
  template <class Numbers>
  void member(Numbers& numbers) requires is_twofold {
    numbers(fresh_);
    for (int i = 0; i < count(); ++i) {
      for (Parts* parts : {&parts_, &low_, &slopes_}) numbers((*parts)[i].place, (*parts)[i].rate);
    }
  }

  /// Dense output: a part and its rate at the fraction `share` of the last accepted step, by the quintic Hermite
  /// polynomial through both ends with rates and accelerations.
  MovingPart<L, D> at(int i, double share) const { return Quintic(share).at(*this, i); }

  /// Calls visit(i, ξ, ξ̇) for all parts, by dense output.
  template <class Visit>
  void for_each_at(double share, Visit visit) const {
    const Quintic path(share);
    for (int i = 0; i < count(); ++i) {
      const MovingPart<L, D> there = path.at(*this, i);
      visit(i, there.place, there.rate);
    }
  }

  /// Calls visit(i, ξ, ξ̇) for all parts, after a step that ends there.
  template <class Visit>
  void for_each_at_full_order(double share, Visit visit) {
    go_back();
    solve(begin_, L(share) * step_, step_ > L(0.0));
    for (int i = 0; i < count(); ++i) {
      visit(i, detail::values_of(trial_.parts[i].place), detail::values_of(trial_.parts[i].rate));
    }
    go_back();
  }

  /// The longest step in which stages resolve drives: a weak drive that oscillates often within a step would show in no
  /// stage.
  L longest_step(double tolerance) const {
    double turn = nodes;
    if constexpr (can_choose) {
      if (Method::is_blind) turn = SineTurn(nodes, 2 * nodes).within(tolerance);
    }
    return dynamics_.template longest_step<nodes>(turn);
  }

  /// Tries a step of `h` from `time`. Returns which of the `wanted` members have a finite result and turn by less than
  /// half a turn. The state is unchanged.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& time, const L& h, const Mask& wanted) {
    refresh(time);
    detail::unrolled<stages - 1>([&](auto s) PENDULA_WRITTEN_OUT {
      constexpr auto stage = static_cast<std::size_t>(s) + 1;
      weigh<stage>(h, Method::a[stage], stages_);
      dynamics_.slopes(fma(h, L(detail::node_of(Method::a[stage])), time), stages_, inner_slopes_[stage - 1]);
    });
    State::arrive(
        h, [&](auto i) PENDULA_WRITTEN_OUT { return weighed<Method::stages>(Method::b, i); }, trial_.parts, trial_.low);
    dynamics_.slopes(time + h, trial_.parts, trial_.slopes);
    const L pace = dynamics_.pace_squared(trial_.parts);
    if constexpr (can_choose) find_error(time, h, pace);
    tried_ = h;
    tried_from_ = time;
    if constexpr (!Dynamics::limits_turns) return wanted & (pace <= L(std::numeric_limits<double>::infinity()));
    const L turned = max(pace, State::pace_squared()) * (h * h);
    return wanted & (turned < L(largest_turn * largest_turn));
  }

  /// Squared error of the tried step, relative to the size of the motion.
  const L& error_squared() const { return error_; }

  /// The end of the tried step.
  const Parts& tried() const { return trial_.parts; }

  /// The first part of the tried step that is not finite; −1: none.
  int part_not_finite() const requires is_twofold { return State::not_finite(trial_.parts); }

  /// Moves these members to the end of the tried step.
  void accept(const Mask& which) {
    step_ = select(which, tried_, step_);
    begin_ = select(which, tried_from_, begin_);
    now_ = select(which, tried_from_ + tried_, now_);
    if constexpr (is_twofold) {
      change_place(before_);
      change_place(trial_);
    } else {
      dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
        State::assign(which, State::at(parts_, i), State::at(before_.parts, i));
        State::assign(which, State::at(slopes_, i), State::at(before_.slopes, i));
        State::assign(which, State::at(trial_.parts, i), State::at(parts_, i));
        State::assign(which, State::at(trial_.slopes, i), State::at(slopes_, i));
      });
    }
  }

  /// Makes dense output treat the way from `begin` to the current state as a single step.
  void set_step(const FullState& begin, double time, double h) requires is_twofold {
    before_ = begin;
    begin_ = time;
    step_ = h;
  }
  const FullState& begin() const { return before_; }

  /// Logarithm of the growth of these members' tangents since they had length 1; scales them to length 1 again.
  L take_growth(const Mask& which) requires(Dynamics::has_tangent) {
    const L squared = dynamics_.tangent_squared(parts_), factor = State::to_unit_length(which, squared);
    for (int i = 0; i < count(); ++i) {
      State::scale_tangent(factor, parts_[i]);
      State::scale_tangent(factor, slopes_[i]);
    }
    return 0.5 * log(squared);
  }

 private:
  using State::dynamics_;
  using State::largest_turn;
  using State::low_;
  using State::now_;
  using State::parts_;

  static const L& value(const Number& number) { return detail::value_of(number); }

  class Quintic {
   public:
    explicit Quintic(double u)
        : rise_(u * u * u * (10 - 15 * u + 6 * u * u)),
          turn_on_(u * cubed(u - 1) * (-1 - 3 * u)),
          turn_off_(u * u * u * (u - 1) * (4 - 3 * u)),
          bend_on_(-0.5 * u * u * cubed(u - 1)),
          bend_off_(0.5 * u * u * u * squared(u - 1)),
          rise_rate_(30 * u * u * squared(u - 1)),
          turn_on_rate_(squared(u - 1) * (1 - 3 * u) * (1 + 5 * u)),
          turn_off_rate_(u * u * (-12 + 28 * u - 15 * u * u)),
          bend_on_rate_(-0.5 * u * squared(u - 1) * (5 * u - 2)),
          bend_off_rate_(0.5 * u * u * (u - 1) * (5 * u - 3)) {}

    MovingPart<L, D> at(const ExplicitSteps& steps, int i) const {
      const Part &from = steps.before_.parts[i], &to = steps.parts_[i];
      const auto &bend = steps.before_.slopes[i].rate, &bend_after = steps.slopes_[i].rate;
      const L &h = steps.step_, inverse_h = L(1.0) / h;
      MovingPart<L, D> there;
      for (std::size_t k = 0; k < D; ++k) {
        const L moved = value(to.place[k]) - value(from.place[k]);
        const L turning = h * value(from.rate[k]), turned = h * value(to.rate[k]);
        const L bending = h * (h * value(bend[k])), bent = h * (h * value(bend_after[k]));
        there.place[k] = value(from.place[k]) + (((rise_ * moved + turn_on_ * turning) + turn_off_ * turned) +
                                                 (bend_on_ * bending + bend_off_ * bent));
        there.rate[k] = inverse_h * (((rise_rate_ * moved + turn_on_rate_ * turning) + turn_off_rate_ * turned) +
                                     (bend_on_rate_ * bending + bend_off_rate_ * bent));
      }
      return there;
    }

   private:
    static double squared(double x) { return x * x; }
    static double cubed(double x) { return x * x * x; }

    L rise_, turn_on_, turn_off_, bend_on_, bend_off_;
    L rise_rate_, turn_on_rate_, turn_off_rate_, bend_on_rate_, bend_off_rate_;
  };

  void change_place(FullState& with) {
    std::swap(parts_, with.parts);
    std::swap(slopes_, with.slopes);
    std::swap(low_, with.low);
  }
  // Swaps the state with that at the start of the last step; a second call swaps back.
  void go_back() { change_place(before_); }

  // Computes the first slopes of members that were just started; the others have those from the end of their last step.
  void refresh(const L& time) {
    const Mask fresh = fresh_ > L(0.0);
    if (!any(fresh)) return;
    fresh_ = L(0.0);
    Parts& found = stages_;  // as scratch space
    dynamics_.slopes(time, parts_, found);
    dynamics_.for_parts([&](auto i)
                            PENDULA_WRITTEN_OUT { State::assign(fresh, State::at(found, i), State::at(slopes_, i)); });
  }

  template <std::size_t j>
  const Parts& slopes_of() const {
    if constexpr (j == 0) {
      return slopes_;
    } else if constexpr (j == Method::stages) {
      return trial_.slopes;
    } else {
      return inner_slopes_[j - 1];
    }
  }

  // Σ weight_j k_j of part i over the first `Count` slopes.
  template <std::size_t Count, class Weights, class Index>
  [[gnu::always_inline]] Part weighed(const Weights& weights, Index i) const {
    Part sum = Part::zero();
    detail::unrolled<static_cast<int>(Count)>([&](auto j) PENDULA_WRITTEN_OUT {
      constexpr auto at = static_cast<std::size_t>(j);
      if (weights[at] == 0) return;
      const L weight(weights[at]);
      const Part& slope = State::at(slopes_of<at>(), i);
      for (std::size_t k = 0; k < D; ++k) {
        sum.place[k] = fma(weight, slope.place[k], sum.place[k]);
        sum.rate[k] = fma(weight, slope.rate[k], sum.rate[k]);
      }
    });
    return sum;
  }

  // The state plus h times the weighted sum of the first `Count` slopes.
  template <std::size_t Count, class Weights>
  [[gnu::always_inline]] void weigh(const L& h, const Weights& weights, Parts& to) {
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const Part moved = weighed<Count>(weights, i), &from = State::at(parts_, i);
      Part& there = State::at(to, i);
      for (std::size_t k = 0; k < D; ++k) {
        if constexpr (is_twofold) {
          const Part& rest = State::at(low_, i);
          there.place[k] = from.place[k] + fma(h, moved.place[k], rest.place[k]);
          there.rate[k] = from.rate[k] + fma(h, moved.rate[k], rest.rate[k]);
        } else {
          there.place[k] = fma(h, moved.place[k], from.place[k]);
          there.rate[k] = fma(h, moved.rate[k], from.rate[k]);
        }
      }
    });
  }

  [[gnu::always_inline]] void find_error(const L& time, const L& h, const L& pace_squared) {
    dynamics_.for_parts([&](auto i)
                            PENDULA_WRITTEN_OUT { State::at(errors_, i) = weighed<Method::stages + 1>(Method::e, i); });
    error_ = dynamics_.error_squared(h, errors_, parts_, slopes_, trial_.parts, pace_squared);
    // For one motion, ForcedSteps checks the forces before the step.
    if constexpr (is_batch<L> && requires { dynamics_.depends_on_time(); }) {
      if (dynamics_.depends_on_time()) {
        error_ = max(error_, dynamics_.template unseen_forcing_squared<nodes>(time, h, parts_));
      }
    }
    // At rest, or nearly so, only the tangent shows which steps are too long.
    if constexpr (has_tangent) {
      const L tangent = (h * h) * (dynamics_.tangent_squared(errors_) / dynamics_.tangent_squared(parts_));
      error_ = max(error_, L(tangent_share * tangent_share) * tangent);
    }
  }

  L fresh_{0.0}, error_{0.0};
  L tried_{0.0}, step_{1.0};        // tried steps, last accepted steps
  L tried_from_{0.0}, begin_{0.0};  // times at which these began
  Parts slopes_;                    // at the current state
  FullState trial_, before_;        // end of the tried step, start of the last one
  Parts stages_;
  std::vector<Parts> inner_slopes_;  // of all stages but the first
  Parts errors_;                     // error of the step divided by its size
};

}  // namespace pendula
