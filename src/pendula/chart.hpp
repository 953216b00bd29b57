#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <pendula/space.hpp>
#include <type_traits>

namespace pendula {

/// Which coordinates a link is described in: û = R û(q) with R the identity (chart 0, the user's angles) or the cyclic
/// permutation of the axes (chart 1, whose poles lie on the y axis). Where one chart fails the other is at its best,
/// so that a chain never meets a pole. In the plane there is only chart 0.
using Chart = std::uint8_t;

template <class Space>
inline constexpr bool has_charts = Space::dof == 2;

/// R x: components in the link's axes, (dimension) -> components in the world's.
template <class Vector>
Vector to_world([[maybe_unused]] Chart chart, const Vector& x) {
  if constexpr (std::tuple_size_v<Vector> == 3) {
    if (chart == 1) return {x[1], x[2], x[0]};
  }
  return x;
}

/// Rᵀ x: the inverse of to_world.
template <class Vector>
Vector to_chart([[maybe_unused]] Chart chart, const Vector& x) {
  if constexpr (std::tuple_size_v<Vector> == 3) {
    if (chart == 1) return {x[2], x[0], x[1]};
  }
  return x;
}

/// visit(chart) with the chart as a constant, so that turning vectors costs nothing but this one decision.
template <class Space, class Visit>
auto in_chart(Chart chart, Visit visit) {
  if constexpr (has_charts<Space>) {
    if (chart == 1) return visit(std::integral_constant<Chart, 1>{});
  }
  return visit(std::integral_constant<Chart, 0>{});
}

/// Axis of the world along which component k in the link's axes lies.
template <class Space>
constexpr int world_axis([[maybe_unused]] Chart chart, int k) {
  if constexpr (has_charts<Space>) return (k + 2 * chart) % 3;
  return k;
}

/// A chart is left where the determinant of its metric, sin²θ, falls below this: |sin θ| < ½.
inline constexpr double chart_limit = 0.25;

/// Direction of a link and its rate, in the axes of the world.
template <class Space, class Real = double>
struct Heading {
  using Link = typename Space::Link;
  typename Link::template Cartesian<Real> u, u_dot;

  Heading(Chart chart, const std::array<Real, Space::dof>& q, const std::array<Real, Space::dof>& v) {
    typename Link::template Trig<Real> trig;
    Link::trig(q, trig);
    *this = of_trig(chart, trig, v);
  }

  /// The same from sines and cosines computed elsewhere.
  static Heading of_trig(Chart chart, const typename Link::template Trig<Real>& trig,
                         const std::array<Real, Space::dof>& v) {
    Heading heading;
    Link::direction(trig, heading.u);
    Link::velocity(trig, v, heading.u_dot);
    heading.u = to_world(chart, heading.u);
    heading.u_dot = to_world(chart, heading.u_dot);
    return heading;
  }

 private:
  Heading() = default;
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

/// Whether a vector has no horizontal part, but for rounding.
template <class Real>
bool is_vertical(const std::array<Real, 3>& x) {
  return norm(x[0], x[1]) < 32 * std::numeric_limits<Real>::epsilon();
}

/// x moved by full turns to within half a turn of `near`.
template <class Real>
Real unwrapped(const Real& x, const Real& near) {
  using std::round;
  const Real turn = 2 * half_turn<Real>();
  return x + turn * round((near - x) / turn);
}

/// Of (θ, φ) and (−θ, φ + π), which are the same direction, whichever lies nearer to `near`.
template <class Real>
std::array<Real, 2> nearest_angles(const std::array<Real, 2>& q, const std::array<Real, 2>& near) {
  const Real minus_theta = -q[0], opposite = q[1] + half_turn<Real>();
  const std::array<Real, 2> same{unwrapped(q[0], near[0]), unwrapped(q[1], near[1])};
  const std::array<Real, 2> other{unwrapped(minus_theta, near[0]), unwrapped(opposite, near[1])};
  const auto distance = [&](const auto& x) { return norm<Real>(x[0] - near[0], x[1] - near[1]); };
  return distance(other) < distance(same) ? other : same;
}

}  // namespace detail

/// The user's θ, φ of a direction, continuous with the angles `near` of a moment before.
///
/// At the pole (sin θ < 32 ulp) φ is the plane in which the link moves, or what it was if the link rests.
template <class Real>
std::array<Real, 2> user_coordinates(const Heading<Spatial, Real>& heading, const std::array<Real, 2>& near) {
  using std::atan2;
  const auto& [u, u_dot] = heading;
  std::array<Real, 2> q;
  Spatial::Link::coordinates(u, q);
  if (detail::is_vertical(u)) {
    const bool rests = detail::is_vertical(u_dot);
    q[1] = rests ? near[1] : atan2(u_dot[1], u_dot[0]);
  }
  return detail::nearest_angles(q, near);
}

/// The same with their rates; at the pole φ̇ is zero.
template <class Real>
LinkAngles<Spatial, Real> user_angles(const Heading<Spatial, Real>& heading, const std::array<Real, 2>& near) {
  LinkAngles<Spatial, Real> angles;
  angles.q = user_coordinates(heading, near);
  Spatial::Link::Trig<Real> trig;
  Real determinant;
  Spatial::Link::trig(angles.q, trig);
  Spatial::Link::metric_determinant(trig, determinant);
  Spatial::Link::rates(trig, detail::is_vertical(heading.u) ? Real(0) : Real(1 / determinant), heading.u_dot, angles.v);
  return angles;
}

}  // namespace pendula
