#pragma once

#include <stdexcept>
#include <string>

namespace pendula::io {

/// An opened file cannot be written: the disk is full, say.
class OutputError : public std::runtime_error {
 public:
  /// `error` is errno.
  OutputError(const std::string& file, int error);
  /// `why` in words.
  OutputError(const std::string& file, const std::string& why);
};

/// Throws InputError: the file cannot be written, because `why`.
[[noreturn]] void reject_output(const std::string& file, const std::string& why);

/// The same for the errno of opening the file; a missing folder is named. Messages call the file `name`.
[[noreturn]] void reject_output(const std::string& name, const std::string& file, int error);

}  // namespace pendula::io
