#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace pendula::io {

/// What a file holds, or why it cannot be read.
struct InputFile {
  std::string text;
  std::string problem;  ///< empty where it was read
};

/// Reads a file of at most `most` bytes. A device, or a pipe that never ends, is read so far and no further; a pipe
/// that nobody opens for writing is given two seconds.
InputFile read_input_file(const std::filesystem::path& file, std::size_t most);

/// Reads standard input in the same way.
InputFile read_standard_input(std::size_t most);

}  // namespace pendula::io
