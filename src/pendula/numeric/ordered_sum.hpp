#pragma once

#include <pendula/numeric/compensated.hpp>

namespace pendula {

/// a + b without rounding error where |a| ≥ |b| (fast two-sum, Dekker); else to within a last bit of b.
template <class Number>
Twofold<Number> ordered_sum(const Number& a, const Number& b) {
  const Number sum = a + b;
  return {sum, b - (sum - a)};
}

}  // namespace pendula
