#include "io/file_format.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "io/input_error.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 3> hdf5_endings = {".h5", ".hdf5", ".nc"};

bool has_ending_of(const std::string& file, FileFormat format) {
  if (format == FileFormat::csv) return file.ends_with(".csv");
  return std::ranges::any_of(hdf5_endings, [&](std::string_view ending) { return file.ends_with(ending); });
}

/// A device or a pipe: rows go there as they come, whatever its name.
bool is_stream(const std::string& file) {
  std::error_code unknown;
  const fs::file_status status = fs::status(file, unknown);
  return file == "-" || (fs::exists(status) && !fs::is_regular_file(status));
}

}  // namespace

FileFormat format_of(const std::string& file) {
  if (has_ending_of(file, FileFormat::hdf5)) return FileFormat::hdf5;
  if (has_ending_of(file, FileFormat::csv) || is_stream(file)) return FileFormat::csv;
  throw InputError(file +
                   ": expected a name that ends in .csv, or in .h5, .hdf5 or .nc (HDF5), or - for standard "
                   "output");
}

void require_format(const std::string& file, FileFormat format, const std::string& what) {
  if (has_ending_of(file, format) || (format == FileFormat::csv && is_stream(file))) return;
  const std::string endings = format == FileFormat::csv ? ".csv" : ".h5, .hdf5 or .nc";
  throw InputError(file + ": expected a name that ends in " + endings + ", for " + what);
}

}  // namespace pendula::io
