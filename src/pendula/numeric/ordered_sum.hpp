#pragma once

#include <pendula/numeric/compensated.hpp>

namespace pendula {

/// a + b without loss where |a| ≥ |b|; else within a last bit of b (Dekker).
template <class Number>
Twofold<Number> ordered_sum(const Number& a, const Number& b) {
  const Number sum = a + b;
  return {sum, b - (sum - a)};
}

}  // namespace pendula
