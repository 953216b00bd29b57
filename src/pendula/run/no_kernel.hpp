#pragma once

#include <stdexcept>

namespace pendula {

/// Thrown if a run needs a fixed-n kernel that this build does not have.
class NoKernel : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace pendula
