#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>

namespace pendula {

/// What vectors across a rod of direction û are written in, the same numbers all along a motion. In the plane the one
/// direction that θ grows in; in space, where no such pair exists everywhere, the axes of the world, what lies along û
/// left out.
template <class Space, class Real = double>
class RodFrame {
 public:
  static constexpr std::size_t D = Space::dimension, size = Space::dof == 1 ? 1 : 3;
  using Vector = std::array<Real, D>;

  RodFrame() = default;
  explicit RodFrame(const Vector& direction) : direction_(direction) {}

  /// The vector of component a.
  Vector vector(std::size_t a) const {
    if constexpr (size == 1) {
      return {-direction_[1], direction_[0]};
    } else {
      Vector axis{};
      axis[a] = Real(1);
      return components(axis);
    }
  }

  /// Components of any vector, what lies along û left out.
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
