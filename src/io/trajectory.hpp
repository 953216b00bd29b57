#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/observer.hpp>
#include <span>
#include <string>
#include <vector>

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

/// A file to which the rows of a run are written.
class RowsFile : public Observer {
 public:
  /// Rows in the file.
  virtual std::int64_t rows() const = 0;
};

/// Appends the header line of a trajectory.
void append_header(std::string& text, std::span<const std::string> columns);

/// Appends one row, in the order of the header, each number with 17 significant digits.
void append_row(std::string& text, std::span<const double> numbers);

/// A trajectory as a CSV file of whole rows.
class TrajectoryFile : public RowsFile {
 public:
  /// Opens the file, as LineFile does, and writes the header. Throws InputError if it cannot be opened.
  TrajectoryFile(const std::string& file, std::span<const std::string> columns) : file_(file) {
    append_header(file_.pending(), columns);
  }

  /// Throws OutputError if rows cannot be written.
  void take(const Row& row) override { write(row.numbers); }
  void write(std::span<const double> numbers) {
    append_row(file_.pending(), numbers);
    file_.flush_if_due();
  }

  /// Writes the rest and closes the file. Throws OutputError.
  void finish() override { file_.close(); }

  /// Rows in the file.
  std::int64_t rows() const override { return std::max<std::int64_t>(file_.lines() - 1, 0); }

 private:
  LineFile file_;
};

/// The events of a run as a CSV file: name, time, direction, then the other columns of the trajectory at that instant.
class EventFile : public Observer {
 public:
  /// `columns` are those of the trajectory; the first is the time. Throws InputError if the file cannot be opened.
  EventFile(const std::string& file, std::span<const std::string> columns) : file_(file) {
    std::vector<std::string> header = {"name", "t", "direction"};
    header.insert(header.end(), columns.begin() + 1, columns.end());
    append_header(file_.pending(), header);
  }

  /// `row` has the columns of the trajectory.
  void take(const Row&) override { file_.flush_if_due(); }

  /// Throws OutputError where lines cannot be written.
  void happen(const EventRow& happened) override {
    std::string& text = file_.pending();
    text += happened.event.name + ',';
    append_number(text, happened.row.numbers.front());
    text += happened.up ? ",up," : ",down,";
    append_row(text, happened.row.numbers.subspan(1));
    file_.flush_if_due();
  }

  /// Throws OutputError.
  void finish() override { file_.close(); }

 private:
  LineFile file_;
};

}  // namespace pendula::io
