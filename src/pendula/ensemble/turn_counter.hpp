#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/numeric/lane_pack.hpp>

namespace pendula {

/// Counts the full turns of every member's links, for the angles of their ends: AngleAnchor where a link has moved so
/// far from where it was last followed to.
template <class Space, int N, class L>
class TurnCounter {
  static constexpr std::size_t D = Space::dimension;
  static constexpr std::size_t lanes = static_cast<std::size_t>(L::size);

 public:
  using Mask = typename L::Mask;

  explicit TurnCounter(int links) : links_(links), turns_(links) {}

  /// A member comes into a lane, at angles q; along(i): the rods.
  template <class Along>
  void start(int lane, const double* q, Along along) {
    for (int i = 0; i < links_; ++i) {
      std::array<double, Space::dof> angles;
      for (std::size_t a = 0; a < angles.size(); ++a) angles[a] = q[static_cast<Eigen::Index>(a) * links_ + i];
      Turn& turn = turns_[i];
      turn.anchors[static_cast<std::size_t>(lane)].set(direction_of(along(i), lane), angles);
      note(turn, lane, along(i));
    }
  }

  /// These members have taken a step by which links have turned less than half a turn; `far` are those that may have
  /// gone far and come back.
  template <class Stepper>
  void follow(const Mask& which, const Mask& far, Stepper& stepper) {
    auto& chain = stepper.chain();
    Mask any = far;
    for (int i = 0; i < links_; ++i) {
      const Mask leaving = far | (which & leaves(turns_[i], chain.along(i)));
      turns_[i].begin(leaving);
      any = any | leaving;
    }
    if (!xsimd::any(any)) return;
    go_through_step(stepper);
    for (int i = 0; i < links_; ++i) {
      turns_[i].pass(chain.along(i));
      end_step(i, chain);
    }
  }

  /// Angles of a member's link, known but for rounding.
  auto angles(int lane, int i) const { return turns_[i].anchors[static_cast<std::size_t>(lane)].angles(); }

 private:
  struct Turn {
    std::array<AngleAnchor<Space>, lanes> anchors;
    std::array<L, D> at{};  // where they were last followed to
    L reach{0.0};           // how far angles near the anchor's are the only ones, in lengths, squared
    // Of a step: who leaves; the rod on the way and what it has turned about the axis; whether places on the way were
    // so close that this is known.
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
      turned = turned + select(close, slope / fma(L(0.28), slope * slope, L(1.0)), L(0.0));
      x = rod[0];
      y = rod[1];
    }
  };

  static void note(Turn& turn, int lane, const std::array<L, D>& rod) {
    for (std::size_t k = 0; k < D; ++k) turn.at[k].set(lane, rod[k][lane]);
    turn.reach.set(lane, turn.anchors[static_cast<std::size_t>(lane)].reach_squared());
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

  template <class Stepper>
  void go_through_step(Stepper& stepper) {
    auto& chain = stepper.chain();
    if constexpr (Stepper::is_implicit) {
      for (int j = 0; j < Stepper::stages; ++j) {
        for (int i = 0; i < links_; ++i) turns_[i].pass(chain.along(i, j));
      }
    } else {
      for (const double share : {0.2, 0.4, 0.6, 0.8}) {
        chain.for_each_glance(share, [&](int i, const std::array<L, D>& rod, const auto&) { turns_[i].pass(rod); });
      }
    }
  }

  template <class Chain>
  void end_step(int i, Chain& chain) {
    Turn& turn = turns_[i];
    for (std::size_t at = 0; at < lanes; ++at) {
      const int lane = static_cast<int>(at);
      if (turn.leaving[lane] == 0) continue;
      AngleAnchor<Space>& anchor = turn.anchors[at];
      const std::array<double, D> u = direction_of(chain.along(i), lane);
      if (turn.known[lane] != 0) {
        anchor.turn_to(u, turn.turned[lane]);
      } else {
        follow_path(lane, i, chain);
        anchor.follow(u);
      }
      note(turn, lane, chain.along(i));
    }
  }

  // By a pole: along the polynomial of the member's step.
  template <class Chain>
  [[gnu::noinline]] void follow_path(int lane, int i, Chain& chain) {
    const auto direction_at = [&](double share) {
      std::array<double, D> u{};
      chain.for_each_glance(share, [&](int link, const std::array<L, D>& rod, const auto&) {
        if (link == i) u = direction_of(rod, lane);
      });
      return u;
    };
    turns_[i].anchors[static_cast<std::size_t>(lane)].follow_path(direction_at, 1.0);
  }

  int links_;
  detail::PerLink<Turn, N> turns_;
};

/// In the plane a link has turned once more where it has passed the upward vertical.
template <int N, class L>
class TurnCounter<Planar, N, L> {
 public:
  using Mask = typename L::Mask;

  explicit TurnCounter(int links) : links_(links), turns_(links) {}

  template <class Along>
  void start(int lane, const double* q, Along along) {
    for (int i = 0; i < links_; ++i) {
      Turn& turn = turns_[i];
      for (std::size_t k = 0; k < 2; ++k) turn.at[k].set(lane, along(i)[k][lane]);
      turn.count.set(lane, std::round((q[i] - angle(lane, turn)) / full_turn));
    }
  }

  /// These members have taken a step by which links have turned less than half a turn; `far` are those whose stages
  /// are looked at, too.
  template <class Stepper>
  void follow(const Mask& which, const Mask& far, Stepper& stepper) {
    auto& chain = stepper.chain();
    if constexpr (Stepper::is_implicit) {
      if (xsimd::any(far)) {
        for (int j = 0; j < Stepper::stages; ++j) pass(far, [&](int i) { return chain.along(i, j); });
      }
    }
    pass(which, [&](int i) { return chain.along(i); });
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

  template <class Along>
  void pass(const Mask& which, Along along) {
    for (int i = 0; i < links_; ++i) {
      const std::array<L, 2> rod = along(i);
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
