#pragma once

#include <pendula/chain/chain_end.hpp>
#include <span>
#include <type_traits>

namespace pendula {

/// A chain as plain numbers, as it passes from a program to the compiled library (library.hpp). The memory belongs to
/// the caller.
struct PlainChain {
  struct Drive {
    int link;
    double amplitude[3];  ///< (torque components)
    double frequency, phase;
  };

  int links;
  double gravity;
  const double* masses;   ///< (links)
  const double* lengths;  ///< (links)
  const double* damping;  ///< (links)
  const double* torque;   ///< constant torques link by link, (torque components x links)
  std::span<const Drive> drives;
  const ChainEnd* end = nullptr;  ///< what holds the last bob; null for one that hangs free
};
static_assert(std::is_trivially_copyable_v<PlainChain> && std::is_standard_layout_v<PlainChain>);

}  // namespace pendula
