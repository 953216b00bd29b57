#pragma once

#include <array>
#include <memory>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <string_view>

namespace pendula {

/// What a generated kernel's self-test measured.
struct KernelCheck {
  /// One statement about the kernel, the largest relative error found in it, and what that may be.
  struct Line {
    std::string_view what;
    double error = 0;
    double limit = 0;

    bool ok() const { return error <= limit; }  // false for NaN
  };

  std::array<Line, 7> lines;
};

/// A fixed-n kernel of this build.
struct KernelInfo {
  std::string_view name;   ///< "planar_2"
  std::string_view space;  ///< "planar" or "spatial"
  int links = 0;
};

/// A fixed-n kernel, and what was compiled from it.
struct KernelEntry {
  KernelInfo info;
  std::unique_ptr<PlainIntegrator> (*make)(const PlainChain&, const RunOptions&);
  KernelCheck (*check)(unsigned seed);
};

}  // namespace pendula
