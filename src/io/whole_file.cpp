#include "io/whole_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "io/link_target.hpp"
#include "io/output_error.hpp"

namespace pendula::io {

namespace fs = std::filesystem;

WholeFile::WholeFile(const std::string& name) : name_(name), target_(name) {
  std::error_code unknown;
  if (name.empty() || fs::is_directory(name, unknown)) reject_output(name, name, name.empty() ? ENOENT : EISDIR);
  const bool is_special = fs::exists(name, unknown) && !fs::is_regular_file(name, unknown);
  if (!is_special) target_ = link_target(name);
  if (fs::exists(target_, unknown) && access(target_.c_str(), W_OK) != 0) reject_output(name, target_, errno);
  if (!is_special) part_ = target_ + ".part" + std::to_string(getpid());
  const std::string& opened = is_special ? target_ : part_;
  descriptor_ = open(opened.c_str(), O_WRONLY | O_CLOEXEC | (is_special ? 0 : O_CREAT | O_TRUNC), 0666);
  if (descriptor_ < 0) reject_output(name, target_, errno);
}

WholeFile::~WholeFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  if (!part_.empty()) unlink(part_.c_str());
}

void WholeFile::write(std::string_view text) {
  write_all(text);
  if (::close(std::exchange(descriptor_, -1)) != 0) fail(errno);
  if (!part_.empty() && std::rename(part_.c_str(), target_.c_str()) != 0) fail(errno);
}

void WholeFile::write_all(std::string_view text) const {
  while (!text.empty()) {
    const ssize_t bytes = ::write(descriptor_, text.data(), text.size());
    if (bytes < 0 && errno == EINTR) continue;
    if (bytes <= 0) fail(bytes < 0 ? errno : ENOSPC);
    text.remove_prefix(static_cast<std::size_t>(bytes));
  }
}

void WholeFile::fail(int error) const {
  if (!part_.empty()) unlink(part_.c_str());
  throw OutputError(name_, error);
}

}  // namespace pendula::io
