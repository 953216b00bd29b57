#pragma once

#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/lanes/lane_pack.hpp>

namespace pendula {

/// What sweeps along the chains of all members need to know of one link; every member has masses and lengths of its
/// own. As LinkConstants.
template <class L>
struct LaneLink {
  L mass{1.0}, length{1.0};
  L inverse_square{1.0};                    ///< 1/l²
  Twofold<L> inverse_mass{L(1.0), L(0.0)};  ///< 1/m
  L inverse_masses{1.0};                    ///< 1/m_i + 1/m_{i−1}, 1/m_0 = 0
  L weight{1.0};                            ///< M g, M the mass that the rod carries
  L hanging{0.0};                           ///< M |g|/l

  void set(int lane, const LinkConstants<double>& link) {
    mass.set(lane, link.mass);
    length.set(lane, link.length);
    inverse_square.set(lane, link.inverse_square);
    inverse_mass.value.set(lane, link.inverse_mass.value);
    inverse_mass.low.set(lane, link.inverse_mass.low);
    inverse_masses.set(lane, link.inverse_masses);
    weight.set(lane, link.weight);
    hanging.set(lane, link.hanging);
  }
};

}  // namespace pendula
