#pragma once

#include <pendula/chart.hpp>
#include <pendula/gauss/chain_links.hpp>
#include <pendula/space.hpp>

namespace pendula {

/// Velocities of a chain from its momenta in O(n): the inverse of the mass matrix by two sweeps, in any number type.
///
/// With G_i = Σ_{j≥i} m_j w_j the momentum below rod i, only its part across the rod is given, (Σ_a p_a u^a)/l; along
/// the rod it is a tension that the sweep finds. From the tip inward, G_i = π_i u_i (u_i·w_{i−1}) + γ_i u_i + given
/// part, because a rod hands on nothing but what lies along it: the matrix that the general elimination carries from
/// link to link is of rank one here. One division a link, and no coordinates.
template <class Space, class Real, int N = Eigen::Dynamic>
class TensionSweep {
 public:
  using Cartesian = typename Space::Link::template Cartesian<Real>;

  explicit TensionSweep(int links) : links_(links), carried_(links) {}

  /// Inward, i = n−1 … 0: takes direction u and given momentum across the rod, both in the axes of the world.
  void inward(int i, const LinkConstants& link, const Cartesian& u, const Cartesian& across) {
    Carried& here = carried_[i];
    here.u = u;
    here.across = across;
    const Real m(link.mass), inverse_m(link.inverse_mass);
    if (i == links_ - 1) {
      here.side = scaled(Real(0.0), u);
      here.free = scaled(inverse_m, across);
      here.coupling = here.gamma = Real(0.0);
      here.pi = m;
      return;
    }
    const Carried& next = carried_[i + 1];
    const Real cosine = dot(u, next.u);
    const Real along = dot(u, next.across);
    Cartesian given;
    for (std::size_t k = 0; k < u.size(); ++k) {
      here.side[k] = next.u[k] - cosine * u[k];
      given[k] = (across[k] - (next.across[k] - along * u[k])) - next.gamma * here.side[k];
    }
    const Real e = Real(1.0) / (m + next.pi * dot(here.side, here.side));
    const Real pull = (dot(here.side, given) * e) * next.pi;
    for (std::size_t k = 0; k < u.size(); ++k) here.free[k] = (given[k] - pull * here.side[k]) * inverse_m;
    here.coupling = next.pi * cosine * e;
    here.pi = (next.pi + m) * e * m;
    here.gamma = along + cosine * (next.gamma + pull);
  }

  /// Outward, i = 0 … n−1: gives the rate of the direction and the momentum G below the rod.
  void outward(int i, const LinkConstants& link, Cartesian& u_dot, Cartesian& momentum) {
    const Carried& here = carried_[i];
    if (i == 0) w_ = scaled(Real(0.0), here.u);
    const Real along = dot(here.u, w_);
    const Real side = along * here.coupling;
    const Real tension = here.pi * along + here.gamma;
    for (std::size_t k = 0; k < w_.size(); ++k) {
      const Real w = (along * here.u[k] + here.free[k]) - side * here.side[k];
      u_dot[k] = (w - w_[k]) * Real(link.inverse_length);
      w_[k] = w;
      momentum[k] = tension * here.u[k] + here.across[k];
    }
  }

 private:
  struct Carried {
    Cartesian u, across;
    Cartesian side;  // u of the next link, across u of this one
    Cartesian free;  // w across the rod where the link before rests
    Real coupling, pi, gamma;

    Carried() : coupling(detail::unwritten), pi(detail::unwritten), gamma(detail::unwritten) {
      for (Cartesian* vector : {&u, &across, &side, &free}) vector->fill(Real(detail::unwritten));
    }
  };

  int links_;
  detail::PerLink<Carried, N> carried_;
  Cartesian w_;  // velocity of the bob before
};

}  // namespace pendula
