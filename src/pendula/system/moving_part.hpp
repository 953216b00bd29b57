#pragma once

#include <array>
#include <cstddef>

namespace pendula {

/// Coordinates of a system as parts of dimension one.
struct CoordinateSpace {
  static constexpr int dof = 1;
  static constexpr std::size_t dimension = 1;
};

/// A part of a moving system in all lanes: its position and rate, of D components each; as a slope, their time
/// derivatives.
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
