#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/space.hpp>
#include <type_traits>
#include <utility>

namespace pendula {

/// The number type of a state with coordinates q and rates v.
template <class Motion>
using NumberOf = typename std::remove_cvref_t<decltype(std::declval<const Motion&>().q)>::Scalar;

namespace detail {

/// û, ∂û/∂q and û̇ of one link, from the generated link kernel.
template <class Space, class Real>
struct LinkMotion {
  Eigen::Matrix<Real, Space::dimension, 1> direction, rate;
  Eigen::Matrix<Real, Space::dimension, Space::dof> derivatives;

  template <class Motion>
  LinkMotion(const Motion& motion, int links, int link) {
    using Link = typename Space::Link;
    std::array<Real, Space::dof> q;
    for (int a = 0; a < Space::dof; ++a) q[static_cast<std::size_t>(a)] = motion.q[a * links + link];
    typename Link::template Trig<Real> trig;
    Link::trig(q, trig);
    std::array<Real, Space::dimension> u;
    std::array<std::array<Real, Space::dimension>, Space::dof> u_a;
    Link::direction(trig, u);
    Link::direction_first(trig, u_a);
    direction = Eigen::Map<const Eigen::Matrix<Real, Space::dimension, 1>>(u.data());
    rate.setZero();
    for (int a = 0; a < Space::dof; ++a) {
      const auto& derivative = u_a[static_cast<std::size_t>(a)];
      derivatives.col(a) = Eigen::Map<const Eigen::Matrix<Real, Space::dimension, 1>>(derivative.data());
      rate += motion.v[a * links + link] * derivatives.col(a);
    }
  }
};

}  // namespace detail

/// Visits every bob from the pivot out: visit(i, position r_i [m], velocity ṙ_i [m/s]).
template <class Space, int N, class Motion, class Visit>
void for_each_bob(const Chain<Space, N>& chain, const Motion& motion, Visit visit) {
  using Real = NumberOf<Motion>;
  Eigen::Matrix<Real, Space::dimension, 1> position, velocity;
  position.setZero();
  velocity.setZero();
  for (int i = 0; i < chain.links(); ++i) {
    const detail::LinkMotion<Space, Real> link(motion, chain.links(), i);
    const Real l = Real(chain.lengths()[i]);
    position += l * link.direction;
    velocity += l * link.rate;
    visit(i, position, velocity);
  }
}

/// Positions r_i = Σ_{j≤i} l_j û_j, (dimension x n)  [m]  (paper eq. 1, 2; 24–26).
template <class Space, int N, class Motion, class Real = NumberOf<Motion>>
Points<Space, N, Real> bob_positions(const Chain<Space, N>& chain, const Motion& motion) {
  Points<Space, N, Real> points(Space::dimension, chain.links());
  for_each_bob(chain, motion, [&](int i, const auto& position, const auto&) { points.col(i) = position; });
  return points;
}

/// Velocities of the bobs, (dimension x n)  [m/s].
template <class Space, int N, class Motion, class Real = NumberOf<Motion>>
Points<Space, N, Real> bob_velocities(const Chain<Space, N>& chain, const Motion& motion) {
  Points<Space, N, Real> points(Space::dimension, chain.links());
  for_each_bob(chain, motion, [&](int i, const auto&, const auto& velocity) { points.col(i) = velocity; });
  return points;
}

/// T and U  [J]  (paper eq. 4–6).
template <class Real>
struct Energies {
  Real kinetic{0}, potential{0};
  Real total() const { return kinetic + potential; }
};

template <class Space, int N, class Motion, class Real = NumberOf<Motion>>
Energies<Real> energies(const Chain<Space, N>& chain, const Motion& motion) {
  Energies<Real> energies;
  const Real g = Real(chain.gravity());
  for_each_bob(chain, motion, [&](int i, const auto& position, const auto& velocity) {
    const Real m = Real(chain.masses()[i]);
    energies.kinetic += m * velocity.squaredNorm() / 2;
    energies.potential += m * g * position[Space::dimension - 1];
  });
  return energies;
}

/// H = T + U  [J].
template <class Space, int N, class Motion, class Real = NumberOf<Motion>>
Real energy(const Chain<Space, N>& chain, const Motion& motion) {
  return energies(chain, motion).total();
}

/// Energy errors are relative to this: Σ M_i |g| l_i  [J]; zero without gravity.
template <class Space, int N>
double energy_scale(const Chain<Space, N>& chain) {
  return std::abs(chain.gravity()) * chain.mass_below().dot(chain.lengths());
}

/// Angular momentum about the vertical through the pivot, conserved in space without loads  [kg m²/s].
template <int N, class Motion, class Real = NumberOf<Motion>>
Real vertical_angular_momentum(const Chain<Spatial, N>& chain, const Motion& motion) {
  Real momentum(0);
  for_each_bob(chain, motion, [&](int i, const auto& r, const auto& v) {
    momentum += Real(chain.masses()[i]) * (r[0] * v[1] - r[1] * v[0]);
  });
  return momentum;
}

/// Power that damping takes out, Σ λ_i |û̇_i|²  [W].
template <class Space, int N, class Motion, class Real = NumberOf<Motion>>
Real dissipation(const Chain<Space, N>& chain, const Motion& motion) {
  Real power(0);
  for (int i = 0; i < chain.links(); ++i) {
    power += Real(chain.damping()[i]) * detail::LinkMotion<Space, Real>(motion, chain.links(), i).rate.squaredNorm();
  }
  return power;
}

}  // namespace pendula
