#pragma once

#include <array>
#include <cmath>
#include <pendula/system/system_table.hpp>
#include <string_view>

namespace pendula {

/// The result of checking a generated kernel.
struct KernelCheck {
  /// One statement about the kernel, the largest error found, and the largest one allowed.
  struct Line {
    std::string_view what;
    double error = 0;
    double limit = 0;

    /// Keeps the larger error; NaN counts as the largest, so that the check fails.
    void keep(double found) {
      if (!std::isnan(error) && !(found <= error)) error = found;
    }
  };

  std::array<Line, 12> lines;
  int count = 0;
};

/// Checks the generated kernel of a chain for consistency, with seeded random parameters in random states: every
/// Jacobian against differences of its function, every pair of functions that must agree, and functions of several
/// states against those of one.
KernelCheck check_chain_kernel(const SystemTable& table, unsigned seed);

}  // namespace pendula
