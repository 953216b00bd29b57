#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>

namespace pendula {

/// The frame for vectors across a rod of direction û, continuous along a motion. In the plane it is the direction in
/// which θ grows. In space no pair of directions is continuous everywhere, so that the frame is the three axes of the
/// world, less their parts along û.
template <class Space, class Real = double>
class RodFrame {
 public:
  static constexpr std::size_t D = Space::dimension, size = Space::dof == 1 ? 1 : 3;
  using Vector = std::array<Real, D>;

  RodFrame() = default;
  explicit RodFrame(const Vector& direction) : direction_(direction) {}

  /// Frame vector a.
  Vector vector(std::size_t a) const {
    if constexpr (size == 1) {
      return {-direction_[1], direction_[0]};
    } else {
      Vector axis{};
      axis[a] = Real(1);
      return components(axis);
    }
  }

  /// Components of any vector; its part along û is left out.
  std::array<Real, size> components(const Vector& x) const {
    if constexpr (size == 1) {
      return {direction_[0] * x[1] - direction_[1] * x[0]};
    } else {
      return difference(x, scaled(dot(direction_, x), direction_));
    }
  }

 private:
  Vector direction_{};
};

}  // namespace pendula
