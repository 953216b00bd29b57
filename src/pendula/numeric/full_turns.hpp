#pragma once

#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/numeric.hpp>

namespace pendula::detail {

/// 2π as the sum of two doubles.
inline constexpr double full_turn = 6.283185307179586, full_turn_low = 2.4492935982947064e-16;

/// Full turns are taken out of angles larger than `some_turns`. Beyond `unknown_turns` a double does not resolve the
/// angle within a turn  [rad].
inline constexpr double some_turns = 8, unknown_turns = 1e15;

/// Takes the full turns out of the angles in the mask `among` that have some, and adds their number to `turns`. Without
/// this a double loses digits as turns accumulate: four of them after ten thousand turns.
template <class Num>
void take_out_turns(Compensated<Num>& angle, Num& turns, const MaskOf<Num>& among) {
  const Num size = abs(angle.value);
  const MaskOf<Num> has_some = among & (size > Num(some_turns)) & (size <= Num(unknown_turns));
  if (!any(has_some)) return;
  const Num whole = floor(fma(angle.value, Num(1 / full_turn), Num(0.5)));
  const Twofold<Num> gone = exact_product(whole, Num(full_turn));
  const Twofold<Num> rest = exact_sum(angle.value, -gone.value);
  const Twofold<Num> within =
      exact_sum(rest.value, (rest.low - gone.low) + (angle.compensation - whole * Num(full_turn_low)));
  angle.value = select(has_some, within.value, angle.value);
  angle.compensation = select(has_some, within.low, angle.compensation);
  turns = select(has_some, turns + whole, turns);
}

/// The angle with its turns put back: angle + 2π turns.
template <class Num>
Num with_turns(const Compensated<Num>& angle, const Num& turns) {
  const Twofold<Num> gone = exact_product(turns, Num(full_turn));
  const Twofold<Num> sum = exact_sum(gone.value, angle.value);
  const Num all = sum.value + (sum.low + (gone.low + fma(turns, Num(full_turn_low), angle.compensation)));
  return select(turns == Num(0.0), angle.value, all);
}

}  // namespace pendula::detail
