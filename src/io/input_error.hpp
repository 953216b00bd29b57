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

}  // namespace pendula::io
