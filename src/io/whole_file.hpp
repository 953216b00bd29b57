#pragma once

#include <string>
#include <string_view>

namespace pendula::io {

/// A file that is there whole or not at all: written under another name beside its own, and then renamed. What is no
/// regular file, as /dev/stdout, is written as it is.
class WholeFile {
 public:
  /// Opens the file to write; one that is there stays until `write`. Throws InputError where it cannot be opened.
  explicit WholeFile(const std::string& name);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  /// Writes all there is to write, and gives the file its name. Throws OutputError, and leaves no piece behind.
  void write(std::string_view text);

 private:
  [[noreturn]] void fail(int error) const;
  void write_all(std::string_view text) const;

  std::string name_, target_, part_;  // as it was given; links followed; empty where the target itself is written
  int descriptor_ = -1;
};

}  // namespace pendula::io
