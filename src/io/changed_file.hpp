#pragma once

#include <stdexcept>

namespace pendula::io {

/// A run file whose contents are not what was written; the message says what differs.
class ChangedFile : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace pendula::io
