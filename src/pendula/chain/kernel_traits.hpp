#pragma once

#include <pendula/chain/chain.hpp>
#include <pendula/chain/space.hpp>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace pendula {

/// The space that a generated kernel lives in.
template <class Kernel>
using SpaceOf = std::conditional_t<Kernel::dof == 1, Planar, Spatial>;

/// A chain's numbers as a kernel takes them. Throws std::invalid_argument if the kernel is for another number of links.
template <class Kernel, int N>
typename Kernel::template Parameters<double> kernel_parameters(const Chain<SpaceOf<Kernel>, N>& chain) {
  if (chain.links() != Kernel::links) {
    throw std::invalid_argument("kernel " + std::string(Kernel::name) + ": expected a chain of " +
                                std::to_string(Kernel::links) + " links, got " + std::to_string(chain.links()));
  }
  return {chain.masses(), chain.lengths(), chain.damping(), chain.gravity()};
}

}  // namespace pendula
