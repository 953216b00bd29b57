#pragma once

#include <string>
#include <string_view>

namespace pendula::io {

/// A file that is written under another name and then renamed, so that it is complete or absent. What is no regular
/// file, as /dev/stdout, is written directly.
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

}  // namespace pendula::io
