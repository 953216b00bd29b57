#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

#include "io/errors.hpp"

namespace pendula::io {

/// A file that grows by whole lines, so that it can be read at any time. Lines are written in large blocks, or once a
/// second if they come slowly. `close` writes the rest and throws if that fails; the destructor writes it, too, and
/// does not throw.
class LineFile {
 public:
  /// Opens a file, replacing an existing one; "-" is standard output. Throws InputError if it cannot be opened, or
  /// another process writes it.
  explicit LineFile(const std::string& name);
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;

  /// Lines yet to be written; append new ones here, each ended by a newline.
  std::string& pending() { return pending_; }

  /// Writes the pending lines if there are many, or if a second has passed. Throws OutputError.
  void flush_if_due() {
    if (pending_.size() >= block_size || Clock::now() - flushed_ >= std::chrono::seconds(1)) flush();
  }

  /// Writes the rest and closes the file. Throws OutputError.
  void close();

  /// Complete lines in the file.
  std::int64_t lines() const { return lines_; }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t block_size = std::size_t{1} << 16;

  void flush();
  std::size_t write_pending();
  void cut_off(std::size_t bytes) const;

  std::string name_;
  int descriptor_ = -1;
  std::string pending_;
  Clock::time_point flushed_;  // initially the epoch, so that the first line is written at once
  std::int64_t lines_ = 0;
};

}  // namespace pendula::io
