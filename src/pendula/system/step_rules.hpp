#pragma once

#include <pendula/numeric/numeric.hpp>

/// What all share who take steps of a method's own choice.
namespace pendula::detail {

/// Whether a step of size h ends before `most` is reached, and by more than a sliver. Where it does not, it is made to
/// end there: what is left would be a step of a rounding error.
template <class Num>
MaskOf<Num> ends_before(const Num& h, const Num& most) {
  return h * Num(1 + 1e-9) < most;
}

/// How often a step is tried, shorter each time, before it fails; and so in lanes, where all members wait for it.
inline constexpr int most_attempts = 100, most_attempts_in_lanes = 40;

}  // namespace pendula::detail
