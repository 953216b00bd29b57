#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/run_report.hpp>
#include <string>

#include "cli/terminal_line.hpp"

namespace pendula::cli {

/// A progress line on standard error: share done, rate, remaining time, energy error. Nothing is printed if that is no
/// terminal.
class Progress : public Observer {
 public:
  Progress(const RunSetup& setup, bool wanted)
      : start_time_(setup.start.time),
        duration_(setup.duration),
        every_(setup.rows.any() ? 0 : setup.every),
        scale_(setup.subject->energy_scale().value_or(0)),
        conserves_(!setup.subject->loaded()),
        line_(wanted) {}

  void take(const Row& row) override {
    if (!line_.is_shown()) return;
    if (rows_ == 0) first_share_ = share_at(row.motion.time);
    follow(row.seen);
    line_.draw([&](double seconds) { return line_text(row, seconds); });
  }

  void finish() override { line_.erase(); }

 private:
  // The energy error as in the summary, for the rows so far.
  void follow(const Observation& seen) {
    if (rows_++ == 0) first_energy_ = seen.energy;
    if (!(scale_ > 0)) largest_ = std::max(largest_, std::abs(seen.kinetic) + std::abs(seen.potential()));
  }

  double share_at(double time) const { return duration_ > 0 ? std::min(1.0, (time - start_time_) / duration_) : 1; }

  std::string line_text(const Row& row, double seconds) const {
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
  std::int64_t every_;  // steps from row to row; 0 if rows are wanted at times
  double scale_;
  bool conserves_;
  TerminalLine line_;
  std::int64_t rows_ = 0;
  double first_share_ = 0;                 // of a resumed run: the share that was done before
  double first_energy_ = 0, largest_ = 0;  // J
};

}  // namespace pendula::cli
