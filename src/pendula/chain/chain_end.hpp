#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

namespace pendula {

/// What holds the last bob of a chain: a hook at `at` from the pivot, moved along each axis by
/// amplitude sin(frequency t + phase). Axes are those of bobs: x and y up, or x, y and z up. In the plane the third
/// numbers are not used.
struct ChainEnd {
  std::array<double, 3> at{};         ///< m
  std::array<double, 3> amplitude{};  ///< m
  std::array<double, 3> frequency{};  ///< rad/s
  std::array<double, 3> phase{};      ///< rad

  bool moves() const {
    for (std::size_t k = 0; k < 3; ++k) {
      if (amplitude[k] != 0 && frequency[k] != 0) return true;
    }
    return false;
  }

  /// Where it is along an axis at a time  [m], its rate  [m/s], and its acceleration  [m/s²].
  double place(std::size_t axis, double time) const { return at[axis] + amplitude[axis] * std::sin(angle(axis, time)); }
  double rate(std::size_t axis, double time) const {
    return amplitude[axis] * frequency[axis] * std::cos(angle(axis, time));
  }
  double acceleration(std::size_t axis, double time) const {
    return -amplitude[axis] * frequency[axis] * frequency[axis] * std::sin(angle(axis, time));
  }
  /// How far it moves from a time on, without the rounding of a difference of places  [m].
  double moved(std::size_t axis, double time, double h) const {
    const double half = frequency[axis] * h / 2;
    return 2 * amplitude[axis] * std::cos(angle(axis, time) + half) * std::sin(half);
  }

  /// The highest frequency of what moves  [rad/s].
  double fastest() const {
    double fastest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      if (amplitude[k] != 0) fastest = std::fmax(fastest, std::abs(frequency[k]));
    }
    return fastest;
  }

 private:
  double angle(std::size_t axis, double time) const { return frequency[axis] * time + phase[axis]; }
};
static_assert(std::is_trivially_copyable_v<ChainEnd> && std::is_standard_layout_v<ChainEnd>);

}  // namespace pendula
