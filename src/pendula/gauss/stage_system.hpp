#pragma once

#include <cstddef>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/linear_system.hpp>

namespace pendula::detail {

/// The linear system of one Newton iteration. It has a row and a column for each stage of each coordinate; the stages
/// of one coordinate are consecutive, as in packs.
class StageSystem : public LinearSystem {
 public:
  StageSystem(std::size_t coordinates, int stages)
      : LinearSystem(static_cast<Index>(coordinates) * stages), stages_(static_cast<std::size_t>(stages)) {}

  std::size_t stages() const { return stages_; }

  /// Sets the derivatives of the residuals of coordinate `row` at all stages, with respect to the unknown of coordinate
  /// `column` at stage k.
  template <class L>
  void set_derivative(std::size_t row, std::size_t column, std::size_t k, const L& lanes) {
    write(lanes, &matrix(at(row, 0), at(column, k)));
  }
  template <class L>
  void set_residual(std::size_t row, const L& lanes) {
    write(lanes, &right[at(row, 0)]);
  }
  /// The correction of coordinate k at stage i.
  double correction(std::size_t k, std::size_t i) const { return solution[at(k, i)]; }

  /// The row of coordinate k at stage i.
  Index at(std::size_t k, std::size_t i) const { return static_cast<Index>(k * stages_ + i); }

 private:
  template <class L>
  void write(const L& lanes, double* to) const {
    constexpr auto width = static_cast<std::size_t>(L::size);
    if (stages_ == width) {
      lanes.store_unaligned(to);
      return;
    }
    alignas(pack_alignment) double numbers[width];
    lanes.store(numbers);
    for (std::size_t i = 0; i < width; ++i) {  // width is a constant: otherwise a compiler calls memmove
      if (i < stages_) to[i] = numbers[i];
    }
  }

  std::size_t stages_;
};

}  // namespace pendula::detail
