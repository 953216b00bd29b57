#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <pendula/run/observer.hpp>

namespace pendula::cli {

/// A line on standard error that shows how far a run is; nothing at all where that is no terminal.
class Progress : public Observer {
  using Clock = std::chrono::steady_clock;

 public:
  Progress(double duration, bool wanted) : duration_(duration), shown_(wanted && isatty(STDERR_FILENO) != 0) {}

  void take(const Row& row) override {
    if (!shown_) return;
    const double time = row.motion.time;
    const auto now = Clock::now();
    if (now - last_ < std::chrono::milliseconds(100)) return;
    last_ = now;
    drawn_ = true;
    const double share = duration_ > 0 ? std::min(1.0, time / duration_) : 1.0;
    std::fprintf(stderr, "\r\x1b[K%3.0f %%   t = %.6g of %.6g", 100 * share, time, duration_);
    std::fflush(stderr);
  }

  void finish() override {
    if (drawn_) std::fputs("\r\x1b[K", stderr);
    drawn_ = false;
  }

 private:
  double duration_;
  bool shown_;
  bool drawn_ = false;
  Clock::time_point last_ = Clock::now();
};

}  // namespace pendula::cli
