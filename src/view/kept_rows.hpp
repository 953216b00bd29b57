#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace pendula::view {

/// Rows of a run, thinned so that they never are more than a given number: every stride-th, stride a power of two, and
/// always the first and the last.
class KeptRows {
 public:
  /// width    numbers of a row
  /// most     rows to keep, at least 3
  KeptRows(std::size_t width, std::size_t most);

  void add(std::span<const double> row);

  std::size_t size() const { return regular() + (last_is_regular() ? 0 : 1); }
  std::span<const double> operator[](std::size_t i) const;

  std::int64_t seen() const { return seen_; }      ///< rows that were added
  std::int64_t stride() const { return stride_; }  ///< of those, each so-many-th is here

 private:
  std::size_t regular() const { return rows_.size() / width_; }
  bool last_is_regular() const { return seen_ == 0 || (seen_ - 1) % stride_ == 0; }
  void halve();

  std::size_t width_, most_;
  std::vector<double> rows_, last_;
  std::int64_t seen_ = 0, stride_ = 1;
};

}  // namespace pendula::view
