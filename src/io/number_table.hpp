#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace pendula::io {

/// Columns of a CSV file that somebody measured.
struct NumberTable {
  std::string file;
  std::vector<std::vector<double>> columns;  ///< as they were asked for
  std::vector<std::int64_t> lines;           ///< of each row, counted from 1

  /// `file:line` of a row.
  std::string place(std::size_t row) const;
};

/// Reads some columns by their names, which are in the first line; blank lines are left out. Throws InputError with
/// file, line and column.
NumberTable read_number_table(const std::filesystem::path& file, const std::vector<std::string>& columns);

}  // namespace pendula::io
