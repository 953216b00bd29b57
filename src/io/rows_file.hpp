#pragma once

#include <cstdint>
#include <pendula/run/observer.hpp>

namespace pendula::io {

/// A file that takes the rows of a run.
class RowsFile : public Observer {
 public:
  /// Rows that are in the file.
  virtual std::int64_t rows() const = 0;
};

}  // namespace pendula::io
