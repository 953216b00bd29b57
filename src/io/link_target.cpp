#include "io/link_target.hpp"

#include <filesystem>
#include <system_error>

namespace pendula::io {

std::string link_target(const std::string& name) {
  namespace fs = std::filesystem;
  std::error_code unknown;
  fs::path file = name;
  for (int links = 0; links < 40 && fs::is_symlink(file, unknown); ++links) {
    file = file.parent_path() / fs::read_symlink(file, unknown);
  }
  return file.string();
}

}  // namespace pendula::io
