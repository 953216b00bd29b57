#pragma once

#include <array>
#include <cstddef>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// Weight of the relative error of a tangent in the choice of step sizes.
inline constexpr double tangent_share = 0.01;

// Functions of numbers in lanes with derivatives along tangents (Dual), besides arithmetic.

template <class L>
Dual<L> in_register(const Dual<L>& a) {
  return {in_register(a.value), in_register(a.slope)};
}

template <class Mask, class L>
Dual<L> select(const Mask& which, const Dual<L>& yes, const Dual<L>& no) {
  return {select(which, yes.value, no.value), select(which, yes.slope, no.slope)};
}

/// Derivatives are rounded as usual; only values carry their rounding error.
template <class L>
Twofold<Dual<L>> exact_sum(const Dual<L>& a, const Dual<L>& b) {
  const Twofold<L> sum = exact_sum(a.value, b.value);
  return {{sum.value, a.slope + b.slope}, Dual<L>(sum.low)};
}
template <class L>
Twofold<Dual<L>> ordered_sum(const Dual<L>& a, const Dual<L>& b) {
  const Twofold<L> sum = ordered_sum(a.value, b.value);
  return {{sum.value, a.slope + b.slope}, Dual<L>(sum.low)};
}
template <class L>
Twofold<Dual<L>> exact_product(const Dual<L>& a, const Dual<L>& b) {
  const Twofold<L> product = exact_product(a.value, b.value);
  return {{product.value, fma(a.slope, b.value, a.value * b.slope)}, Dual<L>(product.low)};
}
template <class L>
Twofold<Dual<L>> exact_product(const Dual<L>& a, const L& b) {
  const Twofold<L> product = exact_product(a.value, b);
  return {{product.value, a.slope * b}, Dual<L>(product.low)};
}
template <class L>
Twofold<Dual<L>> exact_product(const L& a, const Dual<L>& b) {
  return exact_product(b, a);
}

namespace detail {

/// Sets the value of one lane, and leaves its derivative.
template <class L>
void set_value(int lane, double value, L& x) {
  set(x, lane, value);
}
template <class L>
void set_value(int lane, double value, Dual<L>& x) {
  set(x.value, lane, value);
}

}  // namespace detail

}  // namespace pendula
