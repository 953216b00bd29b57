#pragma once

#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/lanes/lane_pack.hpp>
#include <pendula/numeric/numeric.hpp>

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
    pendula::set(mass, lane, link.mass);
    pendula::set(length, lane, link.length);
    pendula::set(inverse_square, lane, link.inverse_square);
    pendula::set(inverse_mass.value, lane, link.inverse_mass.value);
    pendula::set(inverse_mass.low, lane, link.inverse_mass.low);
    pendula::set(inverse_masses, lane, link.inverse_masses);
    pendula::set(weight, lane, link.weight);
    pendula::set(hanging, lane, link.hanging);
  }
};

/// Takes over a link of the member in a lane.
template <class L>
void set_link(LinkConstants<L>& link, int lane, const LinkConstants<double>& given) {
  link.mass.set(lane, given.mass);
  link.length.set(lane, given.length);
  link.inverse_length.set(lane, given.inverse_length);
  link.inverse_square.set(lane, given.inverse_square);
  link.inverse_mass.value.set(lane, given.inverse_mass.value);
  link.inverse_mass.low.set(lane, given.inverse_mass.low);
  link.inverse_masses.set(lane, given.inverse_masses);
  link.drag.set(lane, given.drag);
  link.weight.set(lane, given.weight);
  link.hanging.set(lane, given.hanging);
}

}  // namespace pendula
