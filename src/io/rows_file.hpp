#pragma once

#include <cstdint>
#include <pendula/run/observer.hpp>

namespace pendula::io {

/// A file to which the rows of a run are written.
class RowsFile : public Observer {
 public:
  /// Rows in the file.
  virtual std::int64_t rows() const = 0;
};

}  // namespace pendula::io
