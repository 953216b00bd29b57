#include "io/file_lock.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "io/output_error.hpp"

namespace pendula::io {

FileLock::~FileLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

// HDF5 uses flock; readers of the file take that one. This lock is of another kind (OFD).
void FileLock::take(const std::string& file, const std::string& name) {
  descriptor_ = open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor_ < 0) reject_output(name, file, errno);
  struct flock whole {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  if (fcntl(descriptor_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES)) {
    reject_output(name, "one that another run writes");
  }
}

}  // namespace pendula::io
