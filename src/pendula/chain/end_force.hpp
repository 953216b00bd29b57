#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/held_rods.hpp>
#include <pendula/chain/rod_state.hpp>
#include <vector>

namespace pendula {

/// The rods of a chain at a state with angles q and rates v, and their constants.
template <class Space>
struct PlacedRods {
  template <class Motion>
  PlacedRods(const Chain<Space>& chain, const Motion& motion) : constants(chain), rods(chain.links()) {
    for (int i = 0; i < chain.links(); ++i) {
      using Wide = typename RodState<Space>::Wide;
      std::array<Wide, Space::dof> angles, rates;
      for (std::size_t a = 0; a < angles.size(); ++a) {
        const Eigen::Index at = static_cast<Eigen::Index>(a) * chain.links() + i;
        angles[a] = Wide(motion.q[at]);
        rates[a] = Wide(motion.v[at]);
      }
      rods.set_mass(i, constants[i].inverse_mass);
      rods.start(0, i, Wide(constants[i].length), Heading<Space, Wide>(angles, rates));
    }
  }

  ChainLinks<Space> constants;
  RodState<Space> rods;
};

/// The force by which the hook holds the last bob of a chain in a state, (dimension)  [N]; empty where it hangs free.
template <class Space, class Motion>
Eigen::VectorXd end_force(const Chain<Space>& chain, const Motion& motion) {
  if (!chain.is_held()) return {};
  constexpr std::size_t D = Space::dimension;
  using Vector = std::array<double, D>;
  const int last = chain.links() - 1;
  const PlacedRods<Space> placed(chain, motion);
  const auto& constants = placed.constants;
  std::vector<Vector> pulls(static_cast<std::size_t>(chain.links()) + 1, Vector{});  // what loads pull rods with
  if (chain.loaded()) {
    Torque<Space, Eigen::Dynamic> torques;
    chain.torque(motion.time, torques);
    for (int i = 0; i <= last; ++i) {
      const Vector rod = RodState<Space>::vector(placed.rods.along(i)),
                   rate = RodState<Space>::vector(placed.rods.free(i));
      typename Space::Link::template Torque<double> torque;
      for (std::size_t k = 0; k < torque.size(); ++k) {
        torque[k] = torques(static_cast<Eigen::Index>(k), i) * constants[i].inverse_square;
      }
      Vector turning;
      Space::Link::torque_load(torque, rod, turning);
      pulls[static_cast<std::size_t>(i)] = difference(scaled(constants[i].drag, rate), turning);
    }
  }
  const auto bond = [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    return scaled(-constants[i].inverse_mass.value, difference(pulls[at], pulls[at + 1]));
  };
  const auto fallen = [&](int i) {
    if (i > 0) return chain.loaded() ? difference(bond(i), bond(i - 1)) : Vector{};
    Vector first = bond(0);
    first[D - 1] -= chain.gravity();
    return first;
  };
  Vector wanted;
  for (std::size_t k = 0; k < D; ++k) wanted[k] = chain.end()->acceleration(k, motion.time);
  const Vector found = HeldRods<RodState<Space>>::accelerations(placed.rods, constants, fallen, wanted,
                                                                [](int, const Vector&, const Vector&) {});
  return chain.masses()[last] * Eigen::Map<const Eigen::Matrix<double, Space::dimension, 1>>(found.data());
}

}  // namespace pendula
