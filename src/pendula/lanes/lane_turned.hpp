#pragma once

#include <pendula/lanes/lane_pack.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/full_turns.hpp>

namespace pendula {

namespace detail {

/// What Compensated::add makes of a sum.
template <class L>
Twofold<L> added(const Twofold<L>& sum, const L& increment) {
  return exact_sum(sum.value, sum.low + increment);
}

}  // namespace detail

/// One coordinate of several members: a compensated sum, of periodic ones with full turns beside it, which are taken
/// out of it as detail::take_out_turns does.
template <class L>
struct LaneTurned {
  using Mask = typename L::Mask;

  L value{0.0}, low{0.0}, turns{0.0};

  void set(int lane, double q, bool is_periodic) {
    Compensated<double> angle{q, 0};
    double whole = 0;
    if (is_periodic) detail::take_out_turns(angle, whole);
    value.set(lane, angle.value);
    low.set(lane, angle.compensation);
    turns.set(lane, whole);
  }

  /// Of the members `which`.
  void move(const Mask& which, const L& by, bool is_periodic) {
    const Twofold<L> there = detail::added({value, low}, by);
    assign(which, {there.value, there.low, turns});
    if (!is_periodic) return;
    const L size = abs(value);
    const Mask has_some = which & (size > L(detail::some_turns)) & (size <= L(detail::unknown_turns));
    if (xsimd::any(has_some)) take_out(has_some);
  }

  void assign(const Mask& which, const LaneTurned& from) {
    value = select(which, from.value, value);
    low = select(which, from.low, low);
    turns = select(which, from.turns, turns);
  }

  L with_turns() const {
    const Twofold<L> gone = exact_product(turns, L(detail::full_turn));
    const Twofold<L> sum = exact_sum(gone.value, value);
    const L all = sum.value + (sum.low + (gone.low + fma(turns, L(detail::full_turn_low), low)));
    return select(turns == L(0.0), value, all);
  }

 private:
  void take_out(const Mask& which) {
    const L whole = floor(fma(value, L(1 / detail::full_turn), L(0.5)));
    const Twofold<L> gone = exact_product(whole, L(detail::full_turn));
    const Twofold<L> rest = exact_sum(value, -gone.value);
    const Twofold<L> within = exact_sum(rest.value, (rest.low - gone.low) + (low - whole * L(detail::full_turn_low)));
    assign(which, {within.value, within.low, turns + whole});
  }
};

}  // namespace pendula
