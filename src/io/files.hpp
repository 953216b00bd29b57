#pragma once

#include <sys/stat.h>
#include <unistd.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

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

/// A file that is written under another name and then renamed, so that it is complete or absent. A device or pipe, as
/// /dev/stdout, is written directly.
class WholeFile {
 public:
  /// Opens the file for writing; an existing file stays until `write`. Throws InputError if it cannot be opened.
  explicit WholeFile(const std::string& name);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  /// Writes the contents and renames the file. On failure it removes the file and throws OutputError.
  void write(std::string_view text);

 private:
  [[noreturn]] void fail(int error) const;
  void write_all(std::string_view text) const;

  std::string name_, target_,
      part_;  // given name; target of links; name while writing, empty if the target is written directly
  int descriptor_ = -1;
};

/// Follows symbolic links; the file need not exist.
std::string link_target(const std::string& name);

/// Formats of files of numbers.
enum class FileFormat { csv, hdf5 };

/// The format by the ending of the name: CSV for .csv, for "-", and for devices and pipes, as /dev/stdout; HDF5 for
/// .h5, .hdf5 and .nc. Throws InputError with the list for any other name.
FileFormat format_of(const std::string& file);

/// Throws InputError unless a file has the only format in which `what` can be written.
void require_format(const std::string& file, FileFormat format, const std::string& what);

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

/// A folder from which code may be loaded, or why it may not.
struct TrustedFolder {
  std::filesystem::path path;  ///< without symbolic links
  std::string problem;         ///< empty if only its user and root can have put files there
};

/// Makes the folder, if needed, for its user alone. Checks every folder on the path, as sshd does: it must belong to
/// root or to the user of this program, and nobody else may write there, except in sticky folders such as /tmp. The
/// checked path has no symbolic links, so that nobody can redirect it.
TrustedFolder trusted_folder(const std::filesystem::path& folder);

/// Whether anybody but the owner, or a group of the user alone, may write to a file or folder.
bool others_may_write(const struct stat& status);

/// A file descriptor, closed by the destructor; negative if the file could not be opened.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&&) = delete;

  int get() const { return number_; }

 private:
  int number_;
};

}  // namespace pendula::io
