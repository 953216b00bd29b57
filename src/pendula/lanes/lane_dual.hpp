#pragma once

#include <array>
#include <cstddef>
#include <pendula/numeric/compensated.hpp>

namespace pendula {

/// One number of several members of an ensemble (LanePack) with its derivative along a tangent of each. What is
/// computed of values is what would be computed without tangents, to the last bit.
template <class L>
struct LaneDual {
  L value{0.0}, slope{0.0};

  LaneDual() = default;
  explicit LaneDual(double number) : value(number) {}
  explicit LaneDual(const L& number) : value(number) {}
  LaneDual(const L& number, const L& derivative) : value(number), slope(derivative) {}

  friend LaneDual operator+(const LaneDual& a, const LaneDual& b) { return {a.value + b.value, a.slope + b.slope}; }
  friend LaneDual operator-(const LaneDual& a, const LaneDual& b) { return {a.value - b.value, a.slope - b.slope}; }
  friend LaneDual operator-(const LaneDual& a) { return {-a.value, -a.slope}; }
  friend LaneDual operator*(const LaneDual& a, const LaneDual& b) {
    return {a.value * b.value, fma(a.slope, b.value, a.value * b.slope)};
  }
  friend LaneDual operator*(const L& a, const LaneDual& b) { return {a * b.value, a * b.slope}; }
  friend LaneDual operator*(const LaneDual& a, const L& b) { return {a.value * b, a.slope * b}; }
  friend LaneDual operator/(const LaneDual& a, const LaneDual& b) {
    const L inverse = L(1.0) / b.value, ratio = a.value / b.value;
    return {ratio, fma(-ratio, b.slope, a.slope) * inverse};
  }

  friend LaneDual fma(const LaneDual& a, const LaneDual& b, const LaneDual& c) {
    return {fma(a.value, b.value, c.value), fma(a.value, b.slope, fma(a.slope, b.value, c.slope))};
  }
  friend LaneDual fma(const L& a, const LaneDual& b, const LaneDual& c) {
    return {fma(a, b.value, c.value), fma(a, b.slope, c.slope)};
  }
  friend LaneDual fma(const LaneDual& a, const L& b, const LaneDual& c) {
    return {fma(a.value, b, c.value), fma(a.slope, b, c.slope)};
  }

  friend LaneDual fma(const L& a, const L& b, const LaneDual& c) { return {fma(a, b, c.value), c.slope}; }

  friend LaneDual in_register(const LaneDual& a) { return {in_register(a.value), in_register(a.slope)}; }

  template <class Mask>
  friend LaneDual select(const Mask& which, const LaneDual& yes, const LaneDual& no) {
    return {select(which, yes.value, no.value), select(which, yes.slope, no.slope)};
  }
};

/// Of derivatives no more is kept than they are rounded to.
template <class L>
Twofold<LaneDual<L>> exact_sum(const LaneDual<L>& a, const LaneDual<L>& b) {
  const Twofold<L> sum = exact_sum(a.value, b.value);
  return {{sum.value, a.slope + b.slope}, LaneDual<L>(sum.low)};
}
template <class L>
Twofold<LaneDual<L>> ordered_sum(const LaneDual<L>& a, const LaneDual<L>& b) {
  const Twofold<L> sum = ordered_sum(a.value, b.value);
  return {{sum.value, a.slope + b.slope}, LaneDual<L>(sum.low)};
}
template <class L>
Twofold<LaneDual<L>> exact_product(const LaneDual<L>& a, const LaneDual<L>& b) {
  const Twofold<L> product = exact_product(a.value, b.value);
  return {{product.value, fma(a.slope, b.value, a.value * b.slope)}, LaneDual<L>(product.low)};
}
template <class L>
Twofold<LaneDual<L>> exact_product(const LaneDual<L>& a, const L& b) {
  const Twofold<L> product = exact_product(a.value, b);
  return {{product.value, a.slope * b}, LaneDual<L>(product.low)};
}
template <class L>
Twofold<LaneDual<L>> exact_product(const L& a, const LaneDual<L>& b) {
  return exact_product(b, a);
}

/// Of what a tangent errs by, relative to itself, what chosen steps heed.
inline constexpr double tangent_share = 0.01;

namespace detail {

/// What a number is without its derivative, and of the numbers of a vector.
template <class L>
const L& value_of(const L& x) {
  return x;
}
template <class L>
const L& value_of(const LaneDual<L>& x) {
  return x.value;
}
template <class L, std::size_t D>
const std::array<L, D>& values_of(const std::array<L, D>& x) {
  return x;
}
template <class L, std::size_t D>
std::array<L, D> values_of(const std::array<LaneDual<L>, D>& x) {
  std::array<L, D> values;
  for (std::size_t k = 0; k < D; ++k) values[k] = x[k].value;
  return values;
}

template <class L, std::size_t D>
std::array<L, D> slopes_of(const std::array<LaneDual<L>, D>& x) {
  std::array<L, D> slopes;
  for (std::size_t k = 0; k < D; ++k) slopes[k] = x[k].slope;
  return slopes;
}

/// Sets a member's, and leaves its derivative.
template <class L>
void set_value(int lane, double value, L& x) {
  x.set(lane, value);
}
template <class L>
void set_value(int lane, double value, LaneDual<L>& x) {
  x.value.set(lane, value);
}

}  // namespace detail

}  // namespace pendula
