#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/heading.hpp>
#include <pendula/ensemble/step_sight.hpp>
#include <pendula/numeric/full_turns.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <vector>

namespace pendula {

/// Follows the angles of every member's links through full turns and past poles: moves the AngleAnchor of a link when
/// the link has gone too far from it.
template <class Space, class L>
class TurnCounter {
  static constexpr std::size_t D = Space::dimension;
  static constexpr std::size_t lanes = static_cast<std::size_t>(L::size);

 public:
  using Mask = typename L::Mask;

  using Sight = StepSight<L, D>;

  explicit TurnCounter(int links) : links_(links), turns_(at(links)), rods_(at(links)) {}

  /// A member starts in a lane with the angles q; along(i) is its rod i.
  template <class Along>
  void start(int lane, const double* q, Along along) {
    for (int i = 0; i < links_; ++i) {
      std::array<double, Space::dof> angles;
      for (std::size_t a = 0; a < angles.size(); ++a) angles[a] = q[static_cast<Eigen::Index>(a) * links_ + i];
      Turn& turn = turns_[at(i)];
      turn.anchors[at(lane)].set(direction_of(along(i), lane), angles);
      note(turn, lane, along(i));
    }
  }

  /// Call after a step of these members in which no link has turned by half a turn or more; `far` are those that may
  /// have turned far and come back.
  template <class Chain>
  void follow(const Mask& which, const Mask& far, const Chain& chain, Sight& sight) {
    Mask any = far;
    for (int i = 0; i < links_; ++i) {
      const Mask leaving = far | (which & leaves(turns_[at(i)], chain.along(i)));
      turns_[at(i)].begin(leaving);
      any = any | leaving;
    }
    if (!xsimd::any(any)) return;
    for (int k = 0; k < sight.waypoints(); ++k) {
      sight.waypoint(k, rods_);
      pass();
    }
    for (int i = 0; i < links_; ++i) rods_[at(i)].place = chain.along(i);
    pass();
    for (int i = 0; i < links_; ++i) end_step(at(i), chain.along(i), sight);
  }

  /// Angles of the anchor of a member's link. The angles of the link are near these.
  auto angles(int lane, int i) const { return turns_[at(i)].anchors[at(lane)].angles(); }

 private:
  struct Turn {
    std::array<AngleAnchor<Space>, lanes> anchors;
    std::array<L, D> at{};  // where links were last followed to
    L reach{0.0};           // AngleAnchor::reach_squared, relative to the length squared
    // Within a step: which members leave their anchors; the rod on the way and how far it has turned about the axis;
    // whether the places on the way were close enough to know this.
    L leaving{0.0}, x{0.0}, y{0.0}, turned{0.0}, known{1.0};

    void begin(const Mask& leaves) {
      leaving = select(leaves, L(1.0), L(0.0));
      x = at[0];
      y = at[1];
      turned = L(0.0);
      known = L(1.0);
    }

    // As AngleAnchor::follow_through.
    void pass(const std::array<L, D>& rod) {
      const L along = x * rod[0] + y * rod[1], across = x * rod[1] - y * rod[0];
      const Mask close = (along > L(0.0)) & (across * across < 3 * (along * along));
      known = select(close, known, L(0.0));
      const L slope = across / along;
      turned = turned + select(close, slope / fma(L(detail::arctangent_bend), slope * slope, L(1.0)), L(0.0));
      x = rod[0];
      y = rod[1];
    }
  };

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  static void note(Turn& turn, int lane, const std::array<L, D>& rod) {
    for (std::size_t k = 0; k < D; ++k) turn.at[k].set(lane, rod[k][lane]);
    turn.reach.set(lane, turn.anchors[at(lane)].reach_squared());
  }

  static Mask leaves(const Turn& turn, const std::array<L, D>& rod) {
    L squared(0.0), length(0.0);
    for (std::size_t k = 0; k < D; ++k) {
      const L moved = rod[k] - turn.at[k];
      squared = fma(moved, moved, squared);
      length = fma(rod[k], rod[k], length);
    }
    return squared > turn.reach * length;
  }

  void pass() {
    for (std::size_t i = 0; i < turns_.size(); ++i) turns_[i].pass(rods_[i].place);
  }

  // Moves the anchors of link i, now at `rod`.
  [[gnu::noinline]] void end_step(std::size_t i, const std::array<L, D>& rod, Sight& sight) {
    Turn& turn = turns_[i];
    for (std::size_t k = 0; k < lanes; ++k) {
      const int lane = static_cast<int>(k);
      if (turn.leaving[lane] == 0) continue;
      AngleAnchor<Space>& anchor = turn.anchors[k];
      const std::array<double, D> u = direction_of(rod, lane);
      if (turn.known[lane] != 0) {
        anchor.turn_to(u, turn.turned[lane]);
      } else {  // near a pole: along the polynomial of the member's step
        const auto direction_at = [&](double share) {
          sight.at(share, rods_);
          return direction_of(rods_[i].place, lane);
        };
        anchor.follow_path(direction_at, 1.0);
        anchor.follow(u);
      }
      note(turn, lane, rod);
    }
  }

  int links_;
  std::vector<Turn> turns_;
  typename Sight::Parts rods_;  // on the way through a step
};

/// In the plane a full turn is a passage through the upward vertical.
template <class L>
class TurnCounter<Planar, L> {
 public:
  using Mask = typename L::Mask;

  using Sight = StepSight<L, 2>;

  explicit TurnCounter(int links) : links_(links), turns_(at(links)), rods_(at(links)) {}

  template <class Along>
  void start(int lane, const double* q, Along along) {
    for (int i = 0; i < links_; ++i) {
      Turn& turn = turns_[at(i)];
      for (std::size_t k = 0; k < 2; ++k) turn.at[k].set(lane, along(i)[k][lane]);
      turn.count.set(lane, std::round((q[i] - angle(lane, turn)) / detail::full_turn));
    }
  }

  /// Call after a step of these members in which no link has turned by half a turn or more; `far` are those whose
  /// stages are followed, too.
  template <class Chain>
  void follow(const Mask& which, const Mask& far, const Chain& chain, Sight& sight) {
    for (int k = 0; xsimd::any(far) && k < sight.waypoints(); ++k) {
      sight.waypoint(k, rods_);
      pass(far, [&](int i) { return rods_[at(i)].place; });
    }
    pass(which, [&](int i) { return chain.along(i); });
  }

  std::array<double, 1> angles(int lane, int i) const {
    return {angle(lane, turns_[at(i)]) + detail::full_turn * turns_[at(i)].count[lane]};
  }

  /// θ of link i of all members.
  L angles(int i) const { return fma(L(detail::full_turn), turns_[at(i)].count, angle(turns_[at(i)].at)); }

  /// The angle of a rod that lies nearest to another.
  static L near(const std::array<L, 2>& rod, const L& other) {
    const L x = angle(rod);
    return fma(L(detail::full_turn), floor(fma(other - x, L(1 / detail::full_turn), L(0.5))), x);
  }

 private:
  struct Turn {
    std::array<L, 2> at{L(0.0), L(-1.0)};  // the rod when it was last followed
    L count{0.0};
  };

  template <class Along>
  void pass(const Mask& which, Along along) {
    for (int i = 0; i < links_; ++i) {
      const std::array<L, 2> rod = along(i);
      Turn& turn = turns_[at(i)];
      const auto [x, y] = turn.at;
      // Not by ^, which xsimd 8.1 takes for | on the masks of AVX-512.
      const Mask was_left = x < L(0.0), is_left = rod[0] < L(0.0),
                 crosses = which & ((was_left & !is_left) | (is_left & !was_left));
      if (xsimd::any(crosses)) {
        const L side = y * rod[0] - rod[1] * x;  // height where it crosses the vertical, times the way to the right
        turn.count = turn.count + select(crosses & is_left & (side < L(0.0)), L(1.0), L(0.0)) -
                     select(crosses & was_left & (side > L(0.0)), L(1.0), L(0.0));
      }
      for (std::size_t k = 0; k < 2; ++k) turn.at[k] = select(which, rod[k], turn.at[k]);
    }
  }

  static L angle(const std::array<L, 2>& rod) { return atan2(rod[0], -rod[1]); }
  static double angle(int lane, const Turn& turn) {
    std::array<double, 1> q;
    Planar::Link::coordinates(std::array{turn.at[0][lane], turn.at[1][lane]}, q);
    return q[0];
  }

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  int links_;
  std::vector<Turn> turns_;
  typename Sight::Parts rods_;  // on the way through a step
};

}  // namespace pendula
