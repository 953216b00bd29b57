#pragma once

#include <array>
#include <cstddef>

namespace pendula {

/// Where coordinates lie that are numbers and nothing else.
struct CoordinateSpace {
  static constexpr int dof = 1;
  static constexpr std::size_t dimension = 1;
};

/// A part of what moves, of several members of an ensemble: where it is and its rate, of D components; of slopes their
/// derivatives by time.
template <class Number, std::size_t D>
struct MovingPart {
  std::array<Number, D> place, rate;

  static MovingPart zero() {
    MovingPart part;
    part.place.fill(Number(0.0));
    part.rate.fill(Number(0.0));
    return part;
  }
};

}  // namespace pendula
