#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain.hpp>
#include <pendula/chart.hpp>
#include <pendula/gauss/chain_links.hpp>
#include <pendula/invariants.hpp>

namespace pendula {

/// Energy of a chain at one moment, added up link by link from the pivot out, in any coordinates.
template <class Space, class Real = double>
struct EnergyTally {
  Real kinetic{0};      ///< J
  Real potential{0};    ///< J
  Real torque_work{0};  ///< at most what torques do in the step, Σ |torque| |û̇| h  [J]

  /// Adds link i with its direction, its rate and the work that its torque may do.
  template <int N>
  void add(const Chain<Space, N>& chain, int i, const Heading<Space, Real>& heading, const Real& work = Real(0)) {
    const Real l = Real(chain.lengths()[i]), m = Real(chain.masses()[i]);
    position_ = sum(position_, scaled(l, heading.u));
    velocity_ = sum(velocity_, scaled(l, heading.u_dot));
    kinetic += m * dot(velocity_, velocity_) / 2;
    potential += m * Real(chain.gravity()) * position_.back();
    torque_work += work;
  }

  Real energy() const { return kinetic + potential; }

 private:
  std::array<Real, Space::dimension> position_{}, velocity_{};
};

/// Energy that a chain has above an earlier moment and that no torque can have brought, in units of all the energy the
/// chain had: kinetic, and Σ M |g| l. That moment is the start of the run where nothing but weight acts, otherwise the
/// start of the step. On the motion this is a truncation error. The stage equations of too large a step have other
/// solutions, too, in which the chain moves at any speed; those it tells apart.
template <class Space, int N, class Real>
double unexplained_energy(const Chain<Space, N>& chain, const EnergyTally<Space, Real>& start,
                          const EnergyTally<Space, Real>& now) {
  const Real gained = now.energy() - start.energy() - now.torque_work;
  return static_cast<double>(gained / (start.kinetic + energy_scale(chain)));
}

}  // namespace pendula
