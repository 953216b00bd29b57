#include "io/errors.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace pendula::io {

OutputError::OutputError(const std::string& file, int error) : OutputError(file, std::strerror(error)) {}

OutputError::OutputError(const std::string& file, const std::string& why)
    : std::runtime_error(file + ": could not be written: " + why) {}

void reject_output(const std::string& file, const std::string& why) {
  throw InputError(file + ": expected a file that can be written, got: " + why);
}

void reject_output(const std::string& name, const std::string& file, int error) {
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  std::error_code unknown;
  if ((error == ENOENT || error == EISDIR) && !folder.empty() && !std::filesystem::exists(folder, unknown)) {
    reject_output(name, folder.string() + "/ does not exist");
  }
  reject_output(name, std::strerror(error));
}

}  // namespace pendula::io
