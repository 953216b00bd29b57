#pragma once

#include <string>

namespace pendula::io {

/// A write lock on a file, held for as long as this lives.
class FileLock {
 public:
  FileLock() = default;
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock();

  /// Throws InputError if the file cannot be written, or another process writes it; messages call it `name`.
  void take(const std::string& file, const std::string& name);
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_ = -1;
};

}  // namespace pendula::io
