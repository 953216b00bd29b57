#pragma once

#include <array>
#include <cmath>
#include <pendula/system/system_table.hpp>
#include <string_view>

namespace pendula {

/// What a check of a generated kernel measured.
struct KernelCheck {
  /// One statement about the kernel, the largest error found in it, and what that may be.
  struct Line {
    std::string_view what;
    double error = 0;
    double limit = 0;

    /// Takes an error that is larger; NaN counts as the largest, so that the check fails.
    void keep(double found) {
      if (!std::isnan(error) && !(found <= error)) error = found;
    }
  };

  std::array<Line, 11> lines;
  int count = 0;
};

/// Checks the generated kernel of a chain against itself with seeded random parameters in random states: each Jacobian
/// against differences of the function it belongs to, each pair of entry points that must agree, functions of several
/// states against those of one.
KernelCheck check_chain_kernel(const SystemTable& table, unsigned seed);

}  // namespace pendula
