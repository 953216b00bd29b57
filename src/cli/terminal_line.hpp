#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

namespace pendula::cli {

/// A remaining time in words.
inline std::string rest_text(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::min(std::ceil(seconds), 1e15));
  if (whole < 60) return std::to_string(whole) + " s";
  if (whole < 3600) return std::to_string(whole / 60) + " min " + std::to_string(whole % 60) + " s";
  return std::to_string(whole / 3600) + " h " + std::to_string(whole % 3600 / 60) + " min";
}

/// A line on standard error that is redrawn, and removed in the end; nothing if that is no terminal.
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

}  // namespace pendula::cli
