#pragma once

#include <stdexcept>
#include <string>

namespace pendula::io {

/// The user's input is wrong: a file, a key, a value. The message says where, what was expected and what was found. The
/// program ends with exit status 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;

  /// The message `where: key: expected …, got …`.
  InputError(const std::string& where, const std::string& key, const std::string& expected, const std::string& got)
      : std::runtime_error(where + ": " + key + ": expected " + expected + ", got " + got) {}
};

/// The same for the model that a scenario or a command line names. The caller adds where it is named.
class ModelError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An opened file cannot be written, for example because the disk is full.
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

/// A run file whose contents are not what was written; the message says what differs.
class ChangedFile : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace pendula::io
