#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/run_report.hpp>
#include <string>

namespace pendula::cli {

/// How long a rest will take, as people say it.
inline std::string rest_text(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::min(std::ceil(seconds), 1e15));
  if (whole < 60) return std::to_string(whole) + " s";
  if (whole < 3600) return std::to_string(whole / 60) + " min " + std::to_string(whole % 60) + " s";
  return std::to_string(whole / 3600) + " h " + std::to_string(whole % 3600 / 60) + " min";
}

/// A line on standard error that shows how far a run is, how fast, how long it will take and how far its energy is off;
/// nothing at all where that is no terminal.
class Progress : public Observer {
  using Clock = std::chrono::steady_clock;

 public:
  Progress(const RunSetup& setup, bool wanted)
      : start_time_(setup.start.time),
        duration_(setup.duration),
        every_(setup.rows.any() ? 0 : setup.every),
        scale_(setup.subject->energy_scale().value_or(0)),
        conserves_(!setup.subject->loaded()),
        shown_(wanted && isatty(STDERR_FILENO) != 0) {}

  void take(const Row& row) override {
    if (!shown_) return;
    if (rows_ == 0) first_share_ = share_at(row.motion.time);
    follow(row.seen);
    const auto now = Clock::now();
    if (now - drawn_at_ < std::chrono::milliseconds(100)) return;
    drawn_at_ = now;
    is_drawn_ = true;
    std::fputs(("\r\x1b[K" + line(row, std::chrono::duration<double>(now - began_).count())).c_str(), stderr);
    std::fflush(stderr);
  }

  void finish() override {
    if (is_drawn_) std::fputs("\r\x1b[K", stderr);
    is_drawn_ = false;
  }

 private:
  // As the summary compares energies, as far as the run is known.
  void follow(const Observation& seen) {
    if (rows_++ == 0) first_energy_ = seen.energy;
    if (!(scale_ > 0)) largest_ = std::max(largest_, std::abs(seen.kinetic) + std::abs(seen.potential()));
  }

  double share_at(double time) const { return duration_ > 0 ? std::min(1.0, (time - start_time_) / duration_) : 1; }

  std::string line(const Row& row, double seconds) const {
    const double share = share_at(row.motion.time);
    std::string text = rounded(std::floor(100 * share), 3) + " %   t = " + rounded(row.motion.time) + " of " +
                       rounded(start_time_ + duration_);
    if (seconds > 0) {
      const auto rows = static_cast<double>(rows_ - 1);
      text += "   " + (every_ > 0 ? rounded(rows * static_cast<double>(every_) / seconds, 3) + " steps/s"
                                  : rounded(rows / seconds, 3) + " rows/s");
      if (share > first_share_) text += "   " + rest_text(seconds / (share - first_share_) * (1 - share)) + " left";
    }
    const double scale = scale_ > 0 ? scale_ : largest_;
    if (conserves_ && scale > 0) {
      text += "   energy off by " + rounded(std::abs(row.seen.energy - first_energy_) / scale, 2);
    }
    return text;
  }

  double start_time_, duration_;
  std::int64_t every_;  // steps from row to row; 0: rows are wanted at times
  double scale_;
  bool conserves_, shown_;
  bool is_drawn_ = false;
  std::int64_t rows_ = 0;
  double first_share_ = 0;                 // of a run that goes on, what was there already
  double first_energy_ = 0, largest_ = 0;  // J
  Clock::time_point began_ = Clock::now(), drawn_at_ = began_;
};

}  // namespace pendula::cli
