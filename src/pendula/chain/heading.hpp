#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <pendula/chain/space.hpp>
#include <type_traits>

namespace pendula {

namespace detail {

/// x / (1 + arctangent_bend x²) is the arctangent of x to 0.005, for |x| up to √3.
inline constexpr double arctangent_bend = 0.28;

}  // namespace detail

/// Direction of a link and its rate, along the axes of the world.
template <class Space, class Real = double>
struct Heading {
  using Link = typename Space::Link;
  typename Link::template Cartesian<Real> u, u_dot;

  Heading() = default;
  Heading(const std::array<Real, Space::dof>& q, const std::array<Real, Space::dof>& v) {
    typename Link::template Trig<Real> trig;
    Link::trig(q, trig);
    Link::direction(trig, u);
    Link::velocity(trig, v, u_dot);
  }
};

/// Angles and rates of one link as the user reads them.
template <class Space, class Real = double>
struct LinkAngles {
  std::array<Real, Space::dof> q, v;
};

namespace detail {

template <class Real>
Real half_turn() {
  using std::acos;
  if constexpr (std::is_floating_point_v<Real>) return std::numbers::pi_v<Real>;
  return acos(Real(-1));
}

template <class Real>
Real norm(const Real& x, const Real& y) {
  using std::sqrt;
  return sqrt(x * x + y * y);
}

/// The largest horizontal part of a unit vector that counts as vertical: rounding.
template <class Real>
Real vertical() {
  return 32 * std::numeric_limits<Real>::epsilon();
}

/// Whether a unit vector is vertical, except for rounding.
template <class Real>
bool is_vertical(const std::array<Real, 3>& x) {
  return norm(x[0], x[1]) < vertical<Real>();
}

/// x moved by full turns to within half a turn of `near`.
template <class Real>
Real unwrapped(const Real& x, const Real& near) {
  using std::round;
  const Real turn = 2 * half_turn<Real>();
  return x + turn * round((near - x) / turn);
}

/// Angles of a direction in space.
template <class Real>
struct SpatialAngles {
  std::array<Real, 2> q;
  bool opposite = false;  ///< whether sin θ is negative
};

/// (θ, φ) and (−θ, φ + π) are the same direction. Returns whichever lies nearer to `near`.
template <class Real>
SpatialAngles<Real> nearest_angles(const std::array<Real, 2>& q, const std::array<Real, 2>& near) {
  const Real minus_theta = -q[0], across = q[1] + half_turn<Real>();
  const std::array<Real, 2> same{unwrapped(q[0], near[0]), unwrapped(q[1], near[1])};
  const std::array<Real, 2> other{unwrapped(minus_theta, near[0]), unwrapped(across, near[1])};
  const auto distance = [&](const auto& x) { return norm<Real>(x[0] - near[0], x[1] - near[1]); };
  const bool opposite = distance(other) < distance(same);
  return {opposite ? other : same, opposite};
}

}  // namespace detail

/// The user's θ of a direction, continuous with the angle `near` of a moment before.
template <class Real>
std::array<Real, 1> user_coordinates(const Heading<Planar, Real>& heading, const std::array<Real, 1>& near) {
  std::array<Real, 1> q;
  Planar::Link::coordinates(heading.u, q);
  return {detail::unwrapped(q[0], near[0])};
}

namespace detail {

template <class Real>
SpatialAngles<Real> spatial_angles(const Heading<Spatial, Real>& heading, const std::array<Real, 2>& near) {
  using std::atan2;
  const auto& [u, u_dot] = heading;
  std::array<Real, 2> q;
  Spatial::Link::coordinates(u, q);
  if (is_vertical(u)) {
    const bool rests = is_vertical(u_dot);
    q[1] = rests ? near[1] : atan2(u_dot[1], u_dot[0]);
  }
  return nearest_angles(q, near);
}

}  // namespace detail

/// The user's θ, φ of a direction, continuous with the angles `near` of a moment before.
///
/// At the pole (sin θ < 32 ulp) φ is that of the plane in which the link moves, or stays near `near` if it rests.
template <class Real>
std::array<Real, 2> user_coordinates(const Heading<Spatial, Real>& heading, const std::array<Real, 2>& near) {
  return detail::spatial_angles(heading, near).q;
}

/// The user's angles and their rates.
template <class Real>
LinkAngles<Planar, Real> user_angles(const Heading<Planar, Real>& heading, const std::array<Real, 1>& near) {
  using Link = Planar::Link;
  LinkAngles<Planar, Real> angles;
  angles.q = user_coordinates(heading, near);
  Link::Trig<Real> trig;
  Link::trig_of(heading.u, trig);
  Link::rates(trig, Real(1), heading.u_dot, angles.v);
  return angles;
}

/// The same in space; at the pole φ̇ is zero.
template <class Real>
LinkAngles<Spatial, Real> user_angles(const Heading<Spatial, Real>& heading, const std::array<Real, 2>& near) {
  using Link = Spatial::Link;
  const auto [q, opposite] = detail::spatial_angles(heading, near);
  LinkAngles<Spatial, Real> angles{q, {}};
  Link::Trig<Real> trig;
  Real inverse(0);
  if (detail::is_vertical(heading.u)) {
    Link::trig(q, trig);
  } else {
    Link::trig_of(heading.u, trig);
    if (opposite) trig = {-trig.sin_theta, trig.cos_theta, -trig.sin_phi, -trig.cos_phi};
    Link::metric_determinant(trig, inverse);
    inverse = Real(1) / inverse;
  }
  Link::rates(trig, inverse, heading.u_dot, angles.v);
  return angles;
}

/// Direction of the rod of the member in a lane.
template <class L, std::size_t D>
std::array<double, D> direction_of(const std::array<L, D>& rod, int lane) {
  std::array<double, D> u;
  double squared = 0;
  for (std::size_t k = 0; k < D; ++k) {
    u[k] = rod[k][lane];
    squared += u[k] * u[k];
  }
  for (double& x : u) x /= std::sqrt(squared);
  return u;
}

/// A direction with known angles, from which those of later directions are followed. Full turns, and the side on which
/// a link passes a pole, follow from the motion only.
template <class Space, class Real = double>
class AngleAnchor {
  using Cartesian = typename Space::Link::template Cartesian<Real>;
  using Angles = std::array<Real, Space::dof>;

 public:
  void set(const Cartesian& u, const Angles& q) {
    u_ = u;
    q_ = q;
    set_reach();
  }

  /// The link has moved on to u, near to where it was last followed to.
  void follow(const Cartesian& u) {
    if (leaves(u)) move_to(u);
  }

  /// Whether u is so far from where the link was last followed to that the nearest angles may be wrong.
  bool leaves(const Cartesian& u) const {
    Real squared(0);
    for (std::size_t k = 0; k < u.size(); ++k) squared += (u[k] - u_[k]) * (u[k] - u_[k]);
    return squared > reach_squared_;
  }

  /// The link has moved on through these directions, component after component. Returns false, and changes nothing, if
  /// one is so far about the axis from the one before that the way between them is ambiguous.
  template <std::size_t most>
  bool follow_through(const Real (&directions)[Space::dimension][most], std::size_t count) {
    Real x = u_[0], y = u_[1], turned(0);
    for (std::size_t j = 0; j < count; ++j) {
      const Real next_x = directions[0][j], next_y = directions[1][j];
      const Real along = x * next_x + y * next_y, across = x * next_y - y * next_x;
      if (!(along > 0 && across * across < 3 * along * along)) return false;  // a sixth of a turn
      const Real slope = across / along;
      turned += slope / (1 + Real(detail::arctangent_bend) * slope * slope);
      x = next_x;
      y = next_y;
    }
    Cartesian u;
    for (std::size_t k = 0; k < u.size(); ++k) u[k] = directions[k][count - 1];
    turn_to(u, turned);
    return true;
  }

  /// The link has moved on to u, and turned by about so much in the plane, or about the axis  [rad].
  void turn_to(const Cartesian& u, const Real& turned) {
    q_.back() += turned;
    move_to(u);
  }

  /// The link has moved along direction(share), with share from 0, the anchor's own direction, to `end`. It is followed
  /// in parts so short that the nearest angles are right. So the side on which it passes a pole does not depend on
  /// where steps end.
  template <class Direction>
  void follow_path(Direction direction, const Real& end) {
    move_to(direction(Real(0)));
    Real share(0), part(1);  // of the end
    while (share < 1) {
      const Real next = share + part < 1 ? share + part : Real(1);
      const Cartesian u = direction(next * end);
      if (leaves(u) && part > shortest_part) {
        part /= 2;
        continue;
      }
      move_to(u);
      share = next;
      part *= 2;
    }
  }

  /// Where the link was last followed to, and the squared distance from there within which the nearest angles are
  /// right.
  const Cartesian& direction() const { return u_; }
  const Real& reach_squared() const { return reach_squared_; }
  const Angles& angles() const { return q_; }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(u_, q_, reach_squared_);
  }

 private:
  // Shortest part of a path. A pole that is passed within less of it counts as passed through.
  static constexpr double shortest_part = 1.0 / (1 << 20);

  void move_to(const Cartesian& u) {
    Heading<Space, Real> heading;
    heading.u = u;
    heading.u_dot.fill(Real(0));
    set(u, user_coordinates(heading, q_));
  }

  // Within the reach the nearest angles are right. In space it is a quarter of the distance from the axis, and at the
  // pole the distance within which directions count as vertical.
  void set_reach() {
    if constexpr (Space::dof == 1) {
      reach_squared_ = Real(1);
    } else {
      const Real quarter = detail::norm(u_[0], u_[1]) / 4;
      const Real reach = quarter < detail::vertical<Real>() ? detail::vertical<Real>() : quarter;
      reach_squared_ = reach * reach;
    }
  }

  Cartesian u_;
  Angles q_;
  Real reach_squared_;
};

}  // namespace pendula
