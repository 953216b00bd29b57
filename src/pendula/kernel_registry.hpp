#pragma once

#include <memory>
#include <pendula/kernel_check.hpp>
#include <pendula/options.hpp>
#include <span>
#include <string_view>

namespace pendula {

template <class Space, int N>
class Chain;
template <class Space>
class Integrator;

/// A fixed-n kernel of this build.
struct KernelInfo {
  std::string_view name;   ///< "planar_2"
  std::string_view space;  ///< "planar" or "spatial"
  int links = 0;
};

/// A fixed-n kernel, and what was compiled from it.
template <class Space>
struct KernelEntry {
  KernelInfo info;
  std::unique_ptr<Integrator<Space>> (*make)(const Chain<Space, -1>&, const RunOptions&);
  KernelCheck (*check)(unsigned seed);
};

/// The kernels of one space, by number of links; the table is generated with the build.
template <class Space>
std::span<const KernelEntry<Space>> kernel_registry();

}  // namespace pendula
