#pragma once

#include <pendula/numeric/numeric.hpp>

/// Rules that all methods with adaptive steps share.
namespace pendula::detail {

/// Whether h is shorter than `most`, what is left, by more than a billionth of h. If not, callers end the step at
/// `most`, so that no step as short as a rounding error is left over.
template <class Num>
MaskOf<Num> ends_before(const Num& h, const Num& most) {
  return h * Num(1 + 1e-9) < most;
}

/// How often a step is tried, shorter each time, before it fails; less often in lanes, where all members wait for it.
inline constexpr int most_attempts = 100, most_attempts_in_lanes = 40;

}  // namespace pendula::detail
