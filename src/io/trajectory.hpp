#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>

#include "io/line_file.hpp"
#include "io/rows_file.hpp"

namespace pendula::io {

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

}  // namespace pendula::io
