#pragma once

#include <concepts>
#include <cstddef>

namespace pendula {

/// How many numbers a number is: of several members one for each, of one motion one.
template <class Num>
inline constexpr std::size_t width_of = Num::width;
template <std::floating_point Real>
inline constexpr std::size_t width_of<Real> = 1;

/// The number in a row of PackRows of this width.
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
