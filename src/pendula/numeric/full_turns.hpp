#pragma once

#include <cmath>
#include <pendula/numeric/compensated.hpp>

namespace pendula::detail {

/// 2π in twice the digits of a double.
inline constexpr double full_turn = 6.283185307179586, full_turn_low = 2.4492935982947064e-16;

/// From where on an angle has full turns to be taken out, and how far a double tells where it is  [rad].
inline constexpr double some_turns = 8, unknown_turns = 1e15;

/// Takes full turns out of an angle that has some, and adds them to `turns`: of ten thousand turns a double has lost
/// four digits of where it is within one.
inline void take_out_turns(Compensated<double>& angle, double& turns) {
  if (!(std::abs(angle.value) > some_turns) || std::abs(angle.value) > unknown_turns) return;
  const double whole = std::nearbyint(angle.value / full_turn);
  const Twofold<double> gone = exact_product(whole, full_turn);
  const Twofold<double> rest = exact_sum(angle.value, -gone.value);
  const Twofold<double> within =
      exact_sum(rest.value, (rest.low - gone.low) + (angle.compensation - whole * full_turn_low));
  angle = {within.value, within.low};
  turns += whole;
}

/// The angle with its turns.
inline double with_turns(const Compensated<double>& angle, double turns) {
  if (turns == 0) return angle.value;
  const Twofold<double> gone = exact_product(turns, full_turn);
  const Twofold<double> sum = exact_sum(gone.value, angle.value);
  return sum.value + (sum.low + (gone.low + (turns * full_turn_low + angle.compensation)));
}

}  // namespace pendula::detail
