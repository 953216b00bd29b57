#pragma once

#include <array>
#include <cstddef>
#include <pendula/numeric/lanes.hpp>
#include <type_traits>

namespace pendula {

namespace detail {

/// a b + c, with one rounding where the processor has a fast fused multiply-add.
template <class L>
L sum_of_product(const L& a, const L& b, const L& c) {
  if constexpr (std::is_floating_point_v<L>) {
    return fused(a, b, c);
  } else {
    return fma(a, b, c);
  }
}

}  // namespace detail

/// A dual number: a value and its derivative along one direction, for forward-mode differentiation. L is double, or a
/// pack of numbers with a derivative each (Pack, LanePack). Values are those of the same computation without
/// derivatives; with LanePack, which never fuses products with sums, they are equal to the last bit.
template <class L>
struct Dual {
  L value{0.0}, slope{0.0};

  Dual() = default;
  explicit Dual(double number) requires(!std::is_same_v<L, double>) : value(number) {}
  explicit Dual(const L& number) : value(number) {}
  Dual(const L& number, const L& derivative) : value(number), slope(derivative) {}

  friend Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, a.slope + b.slope}; }
  friend Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, a.slope - b.slope}; }
  friend Dual operator-(const Dual& a) { return {-a.value, -a.slope}; }
  friend Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, detail::sum_of_product(a.slope, b.value, a.value * b.slope)};
  }
  friend Dual operator*(const L& a, const Dual& b) { return {a * b.value, a * b.slope}; }
  friend Dual operator*(const Dual& a, const L& b) { return {a.value * b, a.slope * b}; }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const L inverse = L(1.0) / b.value, ratio = a.value / b.value;
    return {ratio, detail::sum_of_product(-ratio, b.slope, a.slope) * inverse};
  }

  friend Dual fma(const Dual& a, const Dual& b, const Dual& c) {
    return {detail::sum_of_product(a.value, b.value, c.value),
            detail::sum_of_product(a.value, b.slope, detail::sum_of_product(a.slope, b.value, c.slope))};
  }
  friend Dual fma(const L& a, const Dual& b, const Dual& c) {
    return {detail::sum_of_product(a, b.value, c.value), detail::sum_of_product(a, b.slope, c.slope)};
  }
  friend Dual fma(const Dual& a, const L& b, const Dual& c) { return fma(b, a, c); }
  friend Dual fma(const L& a, const L& b, const Dual& c) { return {detail::sum_of_product(a, b, c.value), c.slope}; }
};

namespace detail {

/// The value of a number with or without a derivative.
template <class L>
const L& value_of(const L& x) {
  return x;
}
template <class L>
const L& value_of(const Dual<L>& x) {
  return x.value;
}

/// The values of a vector of numbers with or without derivatives.
template <class L, std::size_t D>
const std::array<L, D>& values_of(const std::array<L, D>& x) {
  return x;
}
template <class L, std::size_t D>
std::array<L, D> values_of(const std::array<Dual<L>, D>& x) {
  std::array<L, D> values;
  for (std::size_t k = 0; k < D; ++k) values[k] = x[k].value;
  return values;
}

template <class L, std::size_t D>
std::array<L, D> slopes_of(const std::array<Dual<L>, D>& x) {
  std::array<L, D> slopes;
  for (std::size_t k = 0; k < D; ++k) slopes[k] = x[k].slope;
  return slopes;
}

}  // namespace detail

}  // namespace pendula
