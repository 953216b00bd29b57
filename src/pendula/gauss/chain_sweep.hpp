#pragma once

#include <pendula/chart.hpp>
#include <pendula/gauss/chain_links.hpp>
#include <pendula/space.hpp>

namespace pendula {

/// Velocities of a chain from its momenta in O(n): the inverse of the mass matrix by two sweeps, in any number type.
///
/// With G_i = Σ_{j≥i} m_j before.wj the momentum below rod i, only its part across the rod is given, (Σ_a p_a u^a)/l;
/// along the rod it is a tension that the sweep finds, because a rod hands on nothing but what lies along it: the
/// matrix that the general elimination carries from link to link is of rank one here,
///   G_i = (π_i (u_i·before.w{i−1}) + γ_i) u_i + across_i.
/// One division a link but the last, and no coordinates. What a sweep carries from link to link is the caller's, so
/// that it can stay in registers. Between the sweeps a link keeps three numbers and a vector, no more: on long chains
/// what costs is memory. Directions are cheaper made again than kept.
template <class Space, class Real, int N = Eigen::Dynamic>
class TensionSweep {
 public:
  using Cartesian = typename Space::Link::template Cartesian<Real>;
  using Constants = LinkConstants<ScalarOf<Real>>;

  /// What the inward sweep carries: of the link just done, direction and momentum below it where its rod rests. Below
  /// the last link there is nothing.
  struct Inward {
    Cartesian u = zero(), resting = zero();
    Real pi{0.0};
  };

  /// What the outward sweep carries: the velocity of the bob before.
  struct Outward {
    Cartesian w = zero();
  };

  explicit TensionSweep(int links) : last_(links - 1), carried_(links, unwritten()) {}

  /// Inward, i = n−1 … 0: takes direction u and given momentum across the rod, both in the axes of the world.
  void inward(Inward& next, int i, const Constants& link, const Cartesian& u, const Cartesian& across) {
    const Real m(link.mass), inverse_m(link.inverse_mass);
    if (i == last_) {  // nothing hangs there, and nothing has to be divided
      carried_[i] = {scaled(inverse_m, across), Real(0.0), m, Real(0.0)};
      next = {u, across, m};
      return;
    }
    const Real cosine = dot(u, next.u), along = dot(u, next.resting);
    // The next rod's direction, and what is given of this bob's momentum, across this rod.
    const Cartesian side = difference(next.u, scaled(cosine, u));
    const Cartesian given = difference(across, difference(next.resting, scaled(along, u)));
    const Real e = Real(1.0) / (m + next.pi * dot(side, side));
    const Real pi_e = next.pi * e;
    const Real pull = dot(side, given) * pi_e;
    const Real gamma = along + cosine * pull;
    next.pi = (next.pi + m) * (e * m);
    next.u = u;
    next.resting = sum(across, scaled(gamma, u));
    carried_[i] = {scaled(inverse_m, difference(given, scaled(pull, side))), pi_e * cosine, next.pi, gamma};
  }

  /// Outward, i = 0 … n−1, from what inward was given, and the next link's direction (of the last link: anything
  /// finite): gives the rate of the direction and the momentum G below the rod.
  void outward(Outward& before, int i, const Constants& link, const Cartesian& u, const Cartesian& next_u,
               const Cartesian& across, Cartesian& u_dot, Cartesian& momentum) {
    const Carried& here = carried_[i];
    if (i == 0) {  // nothing moves before
      u_dot = scaled(Real(link.inverse_length), here.free);
      momentum = sum(scaled(here.gamma, u), across);
      before.w = here.free;
      return;
    }
    const Real along = dot(u, before.w);
    const Real aside = along * here.coupling;
    const Real onward = along + aside * dot(u, next_u);
    const Real tension = here.pi * along + here.gamma;
    const Cartesian w = difference(sum(scaled(onward, u), here.free), scaled(aside, next_u));
    u_dot = scaled(Real(link.inverse_length), difference(w, before.w));
    momentum = sum(scaled(tension, u), across);
    before.w = w;
  }

 private:
  static Cartesian zero() {
    return components<Space::dimension>([](std::size_t) { return Real(0.0); });
  }

  struct Carried {
    Cartesian free;  // w across the rod where the bob before rests
    Real coupling, pi, gamma;
  };

  static Carried unwritten() {
    const Real none(detail::unwritten<ScalarOf<Real>>());
    return {components<Space::dimension>([&](std::size_t) { return none; }), none, none, none};
  }

  int last_;
  detail::PerLink<Carried, N> carried_;
};

}  // namespace pendula
