#pragma once

#include <array>
#include <csignal>

namespace pendula::cli {

/// A hang-up does again what it did when the program began. Libraries may have changed that before main: UCX, which
/// comes with Open MPI 5, takes SIGHUP for itself, even where nohup had it ignored.
void restore_hang_up();

/// While it lives, the first interrupt (Ctrl-C), hang-up or request to end is noted, so that the run can stop at its
/// next step and keep what it has; the second ends the program at once.
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
