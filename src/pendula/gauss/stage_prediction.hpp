#pragma once

#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// What the stages of a step are predicted from: an accepted step that it follows, a solved step from the same state,
/// or nothing (cold).
template <class C>
struct StagePrediction {
  MaskOf<C> follows, again, cold;
  C depth;  ///< number of steps of this size that they are predicted from
  C known;  ///< number of steps of this size before
};

namespace detail {

/// A step longer than this many last steps is not predicted from the polynomial of the last one.
inline constexpr double farthest_extrapolation = 1.5;

}  // namespace detail

}  // namespace pendula
