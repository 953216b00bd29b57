#pragma once

#include <array>
#include <csignal>

namespace pendula::cli {

/// Restores the effect that SIGHUP had when the program began. Libraries may have changed it before main: UCX, which
/// comes with Open MPI 5, handles SIGHUP even under nohup.
void restore_hang_up();

/// As long as this lives, it notes the first SIGINT (Ctrl-C), SIGHUP or SIGTERM, so that a run can stop at its next
/// step and keep its results. The second one ends the program at once.
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
