#include "io/trajectory.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <pendula/numeric/number_text.hpp>
#include <utility>

namespace pendula::io {
namespace {

bool is_regular(int descriptor) {
  struct stat status {};
  return fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
}

/// Empties a regular file, unless another run writes it.
void take_over(int descriptor, const std::string& name) {
  if (!is_regular(descriptor)) return;
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    reject_output(name, "one that another run writes");
  if (ftruncate(descriptor, 0) != 0) reject_output(name, name, errno);
}

}  // namespace

LineFile::LineFile(const std::string& name) : name_(name == "-" ? "standard output" : name) {
  descriptor_ = name == "-" ? dup(STDOUT_FILENO) : open(name.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0) reject_output(name_, name, errno);
  if (name == "-") return;
  try {
    take_over(descriptor_, name_);
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

LineFile::~LineFile() {
  if (descriptor_ < 0) return;
  write_pending();
  ::close(descriptor_);
}

void LineFile::close() {
  flush();
  if (::close(std::exchange(descriptor_, -1)) != 0) throw OutputError(name_, errno);
}

void LineFile::flush() {
  const std::size_t wanted = pending_.size();
  const std::size_t written = write_pending();
  const int error = errno;
  flushed_ = Clock::now();
  if (written != wanted) throw OutputError(name_, error);
}

/// Writes as many of the pending lines as possible, and clears them. Returns the bytes written; if that is not all,
/// errno says why.
std::size_t LineFile::write_pending() {
  std::size_t written = 0;
  while (written < pending_.size()) {
    const ssize_t bytes = ::write(descriptor_, pending_.data() + written, pending_.size() - written);
    if (bytes < 0 && errno == EINTR) continue;
    if (bytes <= 0) break;
    written += static_cast<std::size_t>(bytes);
  }
  const int error = errno;
  const auto end = pending_.begin() + static_cast<std::ptrdiff_t>(written);
  lines_ += std::count(pending_.begin(), end, '\n');
  cut_off(static_cast<std::size_t>(end - std::find(std::make_reverse_iterator(end), pending_.rend(), '\n').base()));
  pending_.clear();
  errno = error;
  return written;
}

/// Removes an incomplete line from the end of the file, unless the file is a pipe.
void LineFile::cut_off(std::size_t bytes) const {
  if (bytes == 0 || !is_regular(descriptor_)) return;
  const off_t end = lseek(descriptor_, 0, SEEK_CUR);
  if (end >= 0 && ftruncate(descriptor_, end - static_cast<off_t>(bytes)) != 0) return;  // then the piece stays
}

void append_header(std::string& text, std::span<const std::string> columns) {
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (k > 0) text += ',';
    text += columns[k];
  }
  text += '\n';
}

void append_row(std::string& text, std::span<const double> numbers) {
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    if (k > 0) text += ',';
    append_number(text, numbers[k]);
  }
  text += '\n';
}

}  // namespace pendula::io
