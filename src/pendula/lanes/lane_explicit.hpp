#pragma once

#include <array>
#include <cmath>
#include <pendula/lanes/explicit_tableau.hpp>
#include <pendula/lanes/lane_error_controller.hpp>
#include <pendula/lanes/lane_rods.hpp>
#include <pendula/lanes/lane_state.hpp>
#include <pendula/lanes/lane_tangent.hpp>
#include <pendula/system/forcing_look.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// An explicit Runge–Kutta method on several chains at once, one in each lane, for few digits and short times: as a
/// stepper of LaneQueue. After each step rods have their lengths again, and rates go across. `Dynamics` is LaneRods,
/// with a tangent of each member or without.
template <class Dynamics, class Method>
class LaneExplicit : public LaneState<Dynamics> {
  using State = LaneState<Dynamics>;

 public:
  static constexpr int stages = static_cast<int>(Method::stages);
  static constexpr bool can_choose = Method::error_order > 0;
  using Chain = LaneExplicit;
  using typename State::L;
  using typename State::Mask;
  using typename State::Vector;
  static constexpr std::size_t D = State::D;
  static constexpr bool has_tangent = State::has_tangent;
  using State::links;
  using Controller = LaneErrorController<L, Method::error_order>;

  struct Options {};
  explicit LaneExplicit(typename Dynamics::Subject subject, Options = {})
      : State(subject),
        trial_(parts_),
        before_(parts_),
        stages_(parts_),
        slopes_(Method::stages + 1, parts_),
        before_slopes_(parts_),
        errors_(dynamics_.parts()) {
    for (int i = 0; i < dynamics_.parts(); ++i) {
      for (Parts& slopes : slopes_) slopes[i] = Part::zero();
    }
  }

  LaneExplicit& chain() { return *this; }
  const LaneExplicit& chain() const { return *this; }

  /// A member comes into a lane: LaneRods::start.
  template <class... Start>
  void start(int lane, double time, const Start&... start) {
    State::seat(lane, time, start...);
    fresh_.set(lane, 1);
  }

  /// Parts and rates of the members whose step was accepted when `share` of it was done, by the polynomial of degree
  /// five through both ends with rates and accelerations; visit(i, ξ, ξ̇).
  template <class Visit>
  void for_each_glance(double share, Visit visit) const {
    const double u = share, w = u - 1;
    const L rise(u * u * u * (10 - 15 * u + 6 * u * u)), turn_on(u * w * w * w * (-1 - 3 * u)),
        turn_off(u * u * u * w * (4 - 3 * u)), bend_on(-0.5 * u * u * w * w * w), bend_off(0.5 * u * u * u * w * w);
    const L rise_rate(30 * u * u * w * w), turn_on_rate(w * w * (1 - 3 * u) * (1 + 5 * u)),
        turn_off_rate(u * u * (-12 + 28 * u - 15 * u * u)), bend_on_rate(-0.5 * u * w * w * (5 * u - 2)),
        bend_off_rate(0.5 * u * u * w * (5 * u - 3));
    const L inverse_h = L(1.0) / step_;
    for (int i = 0; i < links(); ++i) {
      const Part &from = before_[i], &to = parts_[i];
      const auto &bend = before_slopes_[i].rate, &bend_after = slopes_[0][i].rate;
      Vector rod, rate;
      for (std::size_t k = 0; k < D; ++k) {
        const L moved = value(to.place[k]) - value(from.place[k]);
        const L turning = step_ * value(from.rate[k]), turned = step_ * value(to.rate[k]);
        const L bending = step_ * (step_ * value(bend[k])), bent = step_ * (step_ * value(bend_after[k]));
        rod[k] = value(from.place[k]) +
                 (((rise * moved + turn_on * turning) + turn_off * turned) + (bend_on * bending + bend_off * bent));
        rate[k] = inverse_h * (((rise_rate * moved + turn_on_rate * turning) + turn_off_rate * turned) +
                               (bend_on_rate * bending + bend_off_rate * bent));
      }
      visit(i, rod, rate);
    }
  }

  /// The same by a step that ends there.
  template <class Visit>
  void for_each_look(double share, Visit visit) {
    go_back();
    solve(begin_, L(share) * step_, step_ > L(0.0));
    for (int i = 0; i < links(); ++i) visit(i, detail::values_of(trial_[i].place), detail::values_of(trial_[i].rate));
    go_back();
  }

  /// In which stages see what drives turn: one that is weak and turns often within a step shows in none what it does.
  L longest_step(double tolerance) const {
    double turn = nodes;
    if constexpr (can_choose) {
      if (Method::is_blind) turn = SineTurn(nodes, 2 * nodes).within(tolerance);
    }
    return dynamics_.template longest_step<nodes>(turn);
  }

  /// Tries a step of `h` from `time`; gives those of the members that are `wanted` to whom nothing happened that is not
  /// finite, and who turn by less than half a turn. The state stays what it was.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& time, const L& h, const Mask& wanted) {
    refresh(time);
    detail::unrolled<static_cast<int>(Method::stages) - 1>([&](auto s) PENDULA_WRITTEN_OUT {
      constexpr auto stage = static_cast<std::size_t>(s) + 1;
      weigh<stage>(h, Method::a[stage], stages_);
      dynamics_.slopes(fma(h, L(detail::node_of(Method::a[stage])), time), stages_, slopes_[stage]);
    });
    weigh<Method::stages>(h, Method::b, trial_);
    dynamics_.restore(trial_);
    dynamics_.slopes(time + h, trial_, slopes_[Method::stages]);
    const L pace = dynamics_.pace_squared(trial_);
    if constexpr (can_choose) find_error(time, h, pace);
    tried_ = h;
    tried_from_ = time;
    const L turned = max(pace, State::pace_squared()) * (h * h);
    return wanted & (turned < L(largest_turn * largest_turn));
  }

  /// What the step errs by, relative to the size of the motion, squared.
  const L& error_squared() const { return error_; }

  /// Moves the members to the end of the step that was tried.
  void accept(const Mask& which) {
    step_ = select(which, tried_, step_);
    begin_ = select(which, tried_from_, begin_);
    now_ = select(which, tried_from_ + tried_, now_);
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      State::assign(which, State::at(parts_, i), State::at(before_, i));
      State::assign(which, State::at(slopes_[0], i), State::at(before_slopes_, i));
      State::assign(which, State::at(trial_, i), State::at(parts_, i));
      State::assign(which, State::at(slopes_[Method::stages], i), State::at(slopes_[0], i));
    });
  }

  /// The logarithm of how long the tangents of these members have grown since they had the length 1, which they have
  /// again after this.
  L take_growth(const Mask& which) requires(Dynamics::has_tangent) {
    const L squared = dynamics_.tangent_squared(parts_), factor = State::to_unit_length(which, squared);
    for (int i = 0; i < links(); ++i) {
      State::scale_tangent(factor, parts_[i]);
      State::scale_tangent(factor, slopes_[0][i]);
    }
    return 0.5 * log(squared);
  }

 private:
  using State::dynamics_;
  using State::largest_turn;
  using State::now_;
  using State::parts_;
  using typename State::Number;
  using typename State::Part;
  using typename State::Parts;

  static constexpr int nodes = (Method::error_order + 2) / 2;  // of the quadrature that is as good

  static const L& value(const Number& number) { return detail::value_of(number); }

  // To where the last step began, and from there.
  void go_back() {
    std::swap(parts_, before_);
    std::swap(slopes_[0], before_slopes_);
  }

  // The first slopes of members that have come into lanes; of others they are those of the last step's end.
  void refresh(const L& time) {
    const Mask fresh = fresh_ > L(0.0);
    if (!xsimd::any(fresh)) return;
    fresh_ = L(0.0);
    Parts& found = stages_;  // slopes are as large
    dynamics_.slopes(time, parts_, found);
    dynamics_.for_parts(
        [&](auto i) PENDULA_WRITTEN_OUT { State::assign(fresh, State::at(found, i), State::at(slopes_[0], i)); });
  }

  // Where the first `Count` slopes lead to, weighed.
  template <std::size_t Count, class Weights>
  [[gnu::always_inline]] void weigh(const L& h, const Weights& weights, Parts& to) {
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      Part moved = Part::zero();
      detail::unrolled<static_cast<int>(Count)>([&](auto j) PENDULA_WRITTEN_OUT {
        const double weight = weights[static_cast<std::size_t>(j)];
        if (weight == 0) return;
        add(L(weight), State::at(slopes_[static_cast<std::size_t>(j)], i), moved);
      });
      const Part& from = State::at(parts_, i);
      Part& there = State::at(to, i);
      for (std::size_t k = 0; k < D; ++k) {
        there.place[k] = fma(h, moved.place[k], from.place[k]);
        there.rate[k] = fma(h, moved.rate[k], from.rate[k]);
      }
    });
  }
  static void add(const L& weight, const Part& slope, Part& sum) {
    for (std::size_t k = 0; k < D; ++k) {
      sum.place[k] = fma(weight, slope.place[k], sum.place[k]);
      sum.rate[k] = fma(weight, slope.rate[k], sum.rate[k]);
    }
  }

  [[gnu::always_inline]] void find_error(const L& time, const L& h, const L& pace_squared) {
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      Part error = Part::zero();
      detail::unrolled<static_cast<int>(Method::stages) + 1>([&](auto j) PENDULA_WRITTEN_OUT {
        constexpr double weight = Method::e[static_cast<std::size_t>(j)];
        if constexpr (weight != 0) {
          const Part& slope = State::at(slopes_[static_cast<std::size_t>(j)], i);
          for (std::size_t k = 0; k < D; ++k) {
            error.place[k] = fma(L(weight), slope.place[k], error.place[k]);
            error.rate[k] = fma(L(weight), slope.rate[k], error.rate[k]);
          }
        }
      });
      State::at(errors_, i) = error;
    });
    error_ = dynamics_.error_squared(h, errors_, parts_, slopes_[0], trial_, pace_squared);
    if constexpr (requires { dynamics_.depends_on_time(); }) {
      if (dynamics_.depends_on_time()) {
        error_ = max(error_, dynamics_.template unseen_forcing_squared<nodes>(time, h, parts_));
      }
    }
    // Where the motion stands still, or almost, nothing but its tangent tells which steps are too long.
    if constexpr (has_tangent) {
      const L tangent = (h * h) * (dynamics_.tangent_squared(errors_) / dynamics_.tangent_squared(parts_));
      error_ = max(error_, L(tangent_share * tangent_share) * tangent);
    }
  }

  L fresh_{0.0}, error_{0.0};
  L tried_{0.0}, step_{1.0};        // the steps that were tried, and those that were taken last
  L tried_from_{0.0}, begin_{0.0};  // when they began
  Parts trial_, before_, stages_;   // before_: where the last step began
  std::vector<Parts> slopes_;       // of the stages, and of the end
  Parts before_slopes_;
  Parts errors_;  // of the step, over its size
};

}  // namespace pendula
