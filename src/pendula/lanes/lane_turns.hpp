#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/lanes/lane_pack.hpp>

namespace pendula {

/// Counts the full turns of every member's links, for the angles of their ends: AngleAnchor where a link has moved so
/// far from where it was last followed to.
template <class Space, int N, class L>
class LaneTurns {
  static constexpr std::size_t D = Space::dimension;
  static constexpr std::size_t lanes = static_cast<std::size_t>(L::size);

 public:
  using Mask = typename L::Mask;

  explicit LaneTurns(int links) : links_(links), turns_(links) {}

  /// A member comes into a lane, at angles q; along(i): the rods.
  template <class Along>
  void start(int lane, const double* q, Along along) {
    for (int i = 0; i < links_; ++i) {
      std::array<double, Space::dof> angles;
      for (std::size_t a = 0; a < angles.size(); ++a) angles[a] = q[static_cast<Eigen::Index>(a) * links_ + i];
      Turn& turn = turns_[i];
      turn.anchors[static_cast<std::size_t>(lane)].set(direction(lane, along(i)), angles);
      note(turn, lane, along(i));
    }
  }

  /// The rods of these members have moved on by less than half a turn.
  template <class Along>
  void follow(const Mask& which, Along along) {
    for (int i = 0; i < links_; ++i) {
      const std::array<L, D>& rod = along(i);
      Turn& turn = turns_[i];
      L squared(0.0), length(0.0);
      for (std::size_t k = 0; k < D; ++k) {
        const L moved = rod[k] - turn.at[k];
        squared = fma(moved, moved, squared);
        length = fma(rod[k], rod[k], length);
      }
      const Mask far = which & (squared > turn.reach * length);
      if (xsimd::any(far)) [[unlikely]]
        follow_far(far, turn, rod);
    }
  }

  /// Angles of a member's link, known but for rounding.
  auto angles(int lane, int i) const { return turns_[i].anchors[static_cast<std::size_t>(lane)].angles(); }

 private:
  struct Turn {
    std::array<AngleAnchor<Space>, lanes> anchors;
    std::array<L, D> at{};  // where they were last followed to
    L reach{0.0};           // how far angles near the anchor's are the only ones, in lengths, squared
  };

  static std::array<double, D> direction(int lane, const std::array<L, D>& rod) {
    std::array<double, D> u;
    double squared = 0;
    for (std::size_t k = 0; k < D; ++k) {
      u[k] = rod[k][lane];
      squared += u[k] * u[k];
    }
    for (double& x : u) x /= std::sqrt(squared);
    return u;
  }

  static void note(Turn& turn, int lane, const std::array<L, D>& rod) {
    for (std::size_t k = 0; k < D; ++k) turn.at[k].set(lane, rod[k][lane]);
    double reach = 1;
    if constexpr (Space::dof == 2) {
      const auto u = direction(lane, rod);
      reach = (u[0] * u[0] + u[1] * u[1]) / 16;
    }
    turn.reach.set(lane, reach);
  }

  [[gnu::noinline]] void follow_far(const Mask& far, Turn& turn, const std::array<L, D>& rod) {
    alignas(pack_alignment) double is_far[lanes];
    select(far, L(1.0), L(0.0)).store(is_far);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (is_far[lane] == 0) continue;
      turn.anchors[lane].follow(direction(static_cast<int>(lane), rod));
      note(turn, static_cast<int>(lane), rod);
    }
  }

  int links_;
  detail::PerLink<Turn, N> turns_;
};

/// In the plane a link has turned once more where it has passed the upward vertical.
template <int N, class L>
class LaneTurns<Planar, N, L> {
 public:
  using Mask = typename L::Mask;

  explicit LaneTurns(int links) : links_(links), turns_(links) {}

  template <class Along>
  void start(int lane, const double* q, Along along) {
    for (int i = 0; i < links_; ++i) {
      Turn& turn = turns_[i];
      for (std::size_t k = 0; k < 2; ++k) turn.at[k].set(lane, along(i)[k][lane]);
      turn.count.set(lane, std::round((q[i] - angle(lane, turn)) / full_turn));
    }
  }

  template <class Along>
  void follow(const Mask& which, Along along) {
    for (int i = 0; i < links_; ++i) {
      const std::array<L, 2>& rod = along(i);
      Turn& turn = turns_[i];
      const auto [x, y] = turn.at;
      // Not by ^, which xsimd 8.1 takes for | on the masks of AVX-512.
      const Mask was_left = x < L(0.0), is_left = rod[0] < L(0.0),
                 crosses = which & ((was_left & !is_left) | (is_left & !was_left));
      if (xsimd::any(crosses)) {
        const L side = y * rod[0] - rod[1] * x;  // of where it crosses the vertical, times the way to the right
        turn.count = turn.count + select(crosses & is_left & (side < L(0.0)), L(1.0), L(0.0)) -
                     select(crosses & was_left & (side > L(0.0)), L(1.0), L(0.0));
      }
      for (std::size_t k = 0; k < 2; ++k) turn.at[k] = select(which, rod[k], turn.at[k]);
    }
  }

  std::array<double, 1> angles(int lane, int i) const {
    return {angle(lane, turns_[i]) + full_turn * turns_[i].count[lane]};
  }

  /// The same of all members.
  L angles(int i) const { return fma(L(full_turn), turns_[i].count, angle(turns_[i].at)); }

  /// The angle of a rod that lies nearest to another.
  static L near(const std::array<L, 2>& rod, const L& other) {
    const L x = angle(rod);
    return fma(L(full_turn), floor(fma(other - x, L(1 / full_turn), L(0.5))), x);
  }

 private:
  struct Turn {
    std::array<L, 2> at{L(0.0), L(-1.0)};  // the rod when it was last followed
    L count{0.0};
  };

  static constexpr double full_turn = 2 * std::numbers::pi;

  static L angle(const std::array<L, 2>& rod) { return atan2(rod[0], -rod[1]); }
  static double angle(int lane, const Turn& turn) {
    std::array<double, 1> q;
    Planar::Link::coordinates(std::array{turn.at[0][lane], turn.at[1][lane]}, q);
    return q[0];
  }

  int links_;
  detail::PerLink<Turn, N> turns_;
};

}  // namespace pendula
