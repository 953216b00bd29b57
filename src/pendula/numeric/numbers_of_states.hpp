#pragma once

#include <pendula/numeric/lanes.hpp>
#include <type_traits>

namespace pendula {

/// One number of each of W states, side by side in memory: a pack, or of one state the number itself.
template <int W, class Register = RegisterFor<W>>
struct NumbersOfStates {
  using L = std::conditional_t<W == 1, double, Pack<W, Register>>;

  static L load(const double* from) {
    if constexpr (W == 1) {
      return *from;
    } else {
      return L::load(from);
    }
  }
  static void store(const L& number, double* to) {
    if constexpr (W == 1) {
      *to = number;
    } else {
      number.store(to);
    }
  }
};

}  // namespace pendula
