#pragma once

#include <concepts>
#include <cstddef>

namespace pendula {

/// Number of members that a number holds: the lanes of a pack, 1 for a plain number.
template <class Num>
inline constexpr std::size_t width_of = Num::width;
template <std::floating_point Real>
inline constexpr std::size_t width_of<Real> = 1;

/// Loads a number from a row of PackRows of its width.
template <class Num>
Num from_row(const double* row) {
  if constexpr (std::floating_point<Num>) {
    return *row;
  } else {
    return Num::load(row);
  }
}
template <class Num>
void to_row(const Num& x, double* row) {
  if constexpr (std::floating_point<Num>) {
    *row = x;
  } else {
    x.store(row);
  }
}

}  // namespace pendula
