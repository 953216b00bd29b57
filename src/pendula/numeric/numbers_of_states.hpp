#pragma once

#include <pendula/numeric/lanes.hpp>
#include <type_traits>

namespace pendula {

/// One quantity of W states, side by side in memory: a pack, or the plain number where W is 1.
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
