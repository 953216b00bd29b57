#include "view/kept_rows.hpp"

#include <algorithm>

namespace pendula::view {

KeptRows::KeptRows(std::size_t width, std::size_t most) : width_(width), most_(std::max<std::size_t>(most, 3)) {}

void KeptRows::add(std::span<const double> row) {
  if (seen_ % stride_ == 0) {
    if (regular() + 1 >= most_) halve();  // one place is for the last row
    if (seen_ % stride_ == 0) rows_.insert(rows_.end(), row.begin(), row.end());
  }
  last_.assign(row.begin(), row.end());
  ++seen_;
}

std::span<const double> KeptRows::operator[](std::size_t i) const {
  if (i == regular()) return last_;
  return {rows_.data() + i * width_, width_};
}

void KeptRows::halve() {
  const std::size_t kept = (regular() + 1) / 2;
  for (std::size_t i = 1; i < kept; ++i) {
    const auto from = rows_.begin() + static_cast<std::ptrdiff_t>(2 * i * width_);
    std::copy_n(from, width_, rows_.begin() + static_cast<std::ptrdiff_t>(i * width_));
  }
  rows_.resize(kept * width_);
  stride_ *= 2;
}

}  // namespace pendula::view
