#pragma once

#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// What the stages of a step are predicted from: whether the last step was accepted, was solved only, or there is none.
template <class C>
struct StagePrediction {
  MaskOf<C> follows, again, cold;
  C depth;  ///< how many steps of this size they are predicted from
  C known;  ///< how many there are
};

namespace detail {

/// Steps that are longer than the last one by more than this factor are out of reach of its polynomial.
inline constexpr double farthest_extrapolation = 1.5;

}  // namespace detail

}  // namespace pendula
