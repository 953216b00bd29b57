#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace pendula::io {

/// The contents of a file, or why it cannot be read.
struct InputFile {
  std::string text;
  std::string problem;  ///< empty where it was read
};

/// Reads a file of at most `most` bytes; no more is read of an endless device or pipe. A pipe that nobody opens for
/// writing is given two seconds.
InputFile read_input_file(const std::filesystem::path& file, std::size_t most);

/// Reads standard input in the same way.
InputFile read_standard_input(std::size_t most);

}  // namespace pendula::io
