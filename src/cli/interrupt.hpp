#pragma once

#include <array>
#include <csignal>

namespace pendula::cli {

/// Restores the effect of SIGHUP that it had when the program began. Libraries may have changed it before main: UCX,
/// which comes with Open MPI 5, takes SIGHUP even if nohup had it ignored.
void restore_hang_up();

/// While it lives, the first SIGINT (Ctrl-C), SIGHUP or SIGTERM is noted, so that a run can stop at its next step and
/// keep its results. The second one ends the program at once.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  bool interrupted() const;

 private:
  static constexpr std::array<int, 3> signals = {SIGINT, SIGTERM, SIGHUP};

  std::array<struct sigaction, signals.size()> before_ = {};
};

}  // namespace pendula::cli
