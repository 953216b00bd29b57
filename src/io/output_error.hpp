#pragma once

#include <stdexcept>
#include <string>

namespace pendula::io {

/// What was to be written could not be, although the file could be opened: the disk is full, say.
class OutputError : public std::runtime_error {
 public:
  /// `error` is errno.
  OutputError(const std::string& file, int error);
  /// `why` in words.
  OutputError(const std::string& file, const std::string& why);
};

/// Throws InputError: the file cannot be written, `why`.
[[noreturn]] void reject_output(const std::string& file, const std::string& why);

/// The same for what errno said when the file was opened; a missing folder is named. `name` is what the message calls
/// it.
[[noreturn]] void reject_output(const std::string& name, const std::string& file, int error);

}  // namespace pendula::io
