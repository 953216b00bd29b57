#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <random>
#include <vector>

namespace pendula {

/// A rod of a chain that moves: ξ  [m], ξ̇  [m/s], 1/l².
template <std::size_t D>
struct MovingRod {
  std::array<double, D> along, rate;
  double inverse_square;
};

/// The initial tangent of a chain in a lane. Every link is turned by a random angle, in space about a random axis, and
/// its rate changed by another; random numbers are the same for all members. Its length is 1: Σ |δξ|²/l² +
/// |δξ̇|²/(l ω)² over all rods, with ω the initial rate of change of the motion.
template <class Space>
class RodTangent {
 public:
  static constexpr std::size_t D = Space::dimension;
  using Vector = std::array<double, D>;

  /// rod(i) returns a MovingRod. `slowest_squared` is a lower bound of ω²  [1/s²].
  template <class Rod>
  RodTangent(int links, double slowest_squared, Rod rod) {
    double squared = slowest_squared;
    for (int i = 0; i < links; ++i) {
      const MovingRod<D> here = rod(i);
      squared = std::max(squared, dot(here.rate, here.rate) * here.inverse_square);
    }
    if (squared > 0) inverse_pace_squared_ = 1 / squared;
    const double pace = squared > 0 ? std::sqrt(squared) : 1;
    std::mt19937 random(1);
    double length = 0;
    for (int i = 0; i < links; ++i) {
      const MovingRod<D> here = rod(i);
      const Turn turned = drawn(random), turning = drawn(random);
      const Vector place = across(turned, here.along);
      const Vector rate = sum(across(turned, here.rate), scaled(pace, across(turning, here.along)));
      length += here.inverse_square * (dot(place, place) + dot(rate, rate) * inverse_pace_squared_);
      moved_.push_back({place, rate});
    }
    length = std::sqrt(length);
    for (auto& moved : moved_) {
      for (Vector& part : moved) part = scaled(1 / length, part);
    }
  }

  const Vector& place(int i) const { return moved_[static_cast<std::size_t>(i)][0]; }  ///< δξ_i
  const Vector& rate(int i) const { return moved_[static_cast<std::size_t>(i)][1]; }   ///< δξ̇_i
  double inverse_pace_squared() const { return inverse_pace_squared_; }  ///< 1/ω²; 1 where nothing moves

 private:
  using Turn = std::array<double, D == 2 ? 1 : 3>;

  static Turn drawn(std::mt19937& random) {
    Turn turn;
    for (double& x : turn) x = static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 0.5;
    return turn;
  }

  static std::array<double, 2> across(const std::array<double, 1>& turn, const std::array<double, 2>& x) {
    return {-turn[0] * x[1], turn[0] * x[0]};
  }
  static std::array<double, 3> across(const std::array<double, 3>& turn, const std::array<double, 3>& x) {
    return {turn[1] * x[2] - turn[2] * x[1], turn[2] * x[0] - turn[0] * x[2], turn[0] * x[1] - turn[1] * x[0]};
  }

  double inverse_pace_squared_ = 1;
  std::vector<std::array<Vector, 2>> moved_;
};

}  // namespace pendula
