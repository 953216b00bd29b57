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

/// A remaining time in words.
inline std::string rest_text(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::min(std::ceil(seconds), 1e15));
  if (whole < 60) return std::to_string(whole) + " s";
  if (whole < 3600) return std::to_string(whole / 60) + " min " + std::to_string(whole % 60) + " s";
  return std::to_string(whole / 3600) + " h " + std::to_string(whole % 3600 / 60) + " min";
}

/// A line on standard error that is redrawn, and removed at the end. Does nothing if standard error is no terminal.
class TerminalLine {
  using Clock = std::chrono::steady_clock;

 public:
  explicit TerminalLine(bool wanted) : shown_(wanted && isatty(STDERR_FILENO) != 0) {}
  ~TerminalLine() { erase(); }
  TerminalLine(const TerminalLine&) = delete;
  TerminalLine& operator=(const TerminalLine&) = delete;

  /// Whether anything is shown.
  bool is_shown() const { return shown_; }

  /// Draws text_of(seconds since the beginning), at most ten times a second.
  template <class TextOf>
  void draw(TextOf&& text_of) {
    const auto now = Clock::now();
    if (!shown_ || now - drawn_at_ < std::chrono::milliseconds(100)) return;
    drawn_at_ = now;
    is_drawn_ = true;
    write("\r\x1b[K" + text_of(std::chrono::duration<double>(now - began_).count()));
  }

  void erase() {
    if (is_drawn_) write("\r\x1b[K");
    is_drawn_ = false;
  }

 private:
  static void write(const std::string& text) {
    std::fputs(text.c_str(), stderr);
    std::fflush(stderr);
  }

  bool shown_;
  bool is_drawn_ = false;
  Clock::time_point began_ = Clock::now(), drawn_at_ = began_;
};

/// A progress line on standard error: share done, rate, remaining time, energy error; nothing if that is no terminal.
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
  double first_share_ = 0;                 // share of a resumed run that was done before
  double first_energy_ = 0, largest_ = 0;  // J
};

}  // namespace pendula::cli
