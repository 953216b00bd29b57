#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>

namespace pendula {

namespace detail {

/// What a push of the last bob by a force moves it by, over the force and times its mass: K = 1 − share x xᵀ, x the
/// last rod. A chain that is stretched straight between its ends cannot give way along x: then share x² = 1.
template <class Number, std::size_t D>
struct EndMobility {
  std::array<Number, D> rod;
  Number share;

  /// K⁻¹ y.
  std::array<Number, D> inverse(const std::array<Number, D>& y) const {
    const Number along = share * dot(rod, y) / (Number(1.0) - share * dot(rod, rod));
    return components<D>([&](std::size_t k) { return Number(y[k] + along * rod[k]); });
  }
  /// K p.
  std::array<Number, D> operator()(const std::array<Number, D>& p) const {
    const Number along = share * dot(rod, p);
    return components<D>([&](std::size_t k) { return Number(p[k] - along * rod[k]); });
  }
  /// How far it gives way along the rod, relative to across.
  Number along() const { return Number(1.0) - share * dot(rod, rod); }
};

}  // namespace detail

}  // namespace pendula
