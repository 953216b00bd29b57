#pragma once

namespace pendula::cli {

/// While it lives, the first interrupt (Ctrl-C) or request to end is noted, so that the run can stop at its next row
/// and keep what it has; the second ends the program at once.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  bool interrupted() const;
};

}  // namespace pendula::cli
