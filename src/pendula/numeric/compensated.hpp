#pragma once

#include <cmath>
#include <limits>
#include <pendula/numeric/fast_fma.hpp>
#include <type_traits>

namespace pendula {

/// A sum carried as value + compensation, so that many small steps lose nothing to rounding (Kahan–Neumaier).
/// T is a number or an Eigen vector; each component of a vector is a sum of its own.
template <class T>
struct Compensated {
  T value;
  T compensation;  ///< rounding error of value: the sum is value + compensation

  void assign(const T& exact) {
    value = exact;
    compensation = exact;
    compensation -= exact;  // zero of the same size
  }

  /// Adds an increment; its rounding error goes into the compensation.
  void add(const T& increment) {
    const T wanted = compensation + increment;
    const T sum = value + wanted;
    const T kept = sum - value;
    compensation = (value - (sum - kept)) + (wanted - kept);
    value = sum;
  }
};

namespace detail {

/// Returns x, and keeps the compiler from fusing the product x with a sum that it enters. Only GCC needs this: Clang
/// fuses within one expression only.
template <class Real>
Real rounded(Real x) {
#if defined(__GNUC__) && !defined(__clang__)
  return __builtin_assoc_barrier(x);
#else
  return x;
#endif
}

}  // namespace detail

/// An unevaluated sum of two numbers, with about twice the digits of one (double-double).
template <class Real>
struct Twofold {
  Real value{0}, low{0};

  /// The same sum, normalised: |low| is at most half a last bit of value. Needs |value| ≥ |low|.
  Twofold settled() const {
    const Real sum = value + low;
    return {sum, low - (sum - value)};
  }

  Real rounded() const { return value + low; }

  friend Twofold operator-(const Twofold& x) { return {-x.value, -x.low}; }
};

/// a + b without rounding error (two-sum, Knuth).
template <class Real>
Twofold<Real> exact_sum(const Real& a, const Real& b) {
  const Real sum = a + b;
  const Real kept = sum - a;
  return {sum, (a - (sum - kept)) + (b - kept)};
}

/// a b without rounding error (two-product: by fused multiply-add, else by Dekker's splitting).
template <class Real>
Twofold<Real> exact_product(const Real& a, const Real& b) {
  const Real product = detail::rounded(Real(a * b));
  if constexpr (detail::has_fast_fma<Real>) {
    return {product, std::fma(a, b, -product)};
  } else {
    const auto high_bits = [](const Real& x) {
      using std::ldexp;
      const Real spread = detail::rounded(Real(x * (ldexp(Real(1), (std::numeric_limits<Real>::digits + 1) / 2) + 1)));
      return spread - (spread - x);
    };
    const Real a_high = high_bits(a), b_high = high_bits(b);
    const Real a_low = a - a_high, b_low = b - b_high;
    return {product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low};
  }
}

template <class Real>
Twofold<Real> operator+(const Twofold<Real>& a, const Twofold<Real>& b) {
  const Twofold<Real> sum = exact_sum(a.value, b.value);
  return Twofold<Real>{sum.value, sum.low + (a.low + b.low)}.settled();
}

template <class Real>
Twofold<Real> operator-(const Twofold<Real>& a, const Twofold<Real>& b) {
  return a + -b;
}

template <class Real>
Twofold<Real> operator*(const Twofold<Real>& a, const Twofold<Real>& b) {
  const Twofold<Real> product = exact_product(a.value, b.value);
  return Twofold<Real>{product.value, product.low + (a.value * b.low + a.low * b.value)}.settled();
}

template <class Real>
Twofold<Real> operator*(const Real& a, const Twofold<Real>& b) {
  const Twofold<Real> product = exact_product(a, b.value);
  return Twofold<Real>{product.value, product.low + a * b.low}.settled();
}

/// 1/x, to about twice the digits of one number.
template <class Real>
Twofold<Real> reciprocal(const Real& x) {
  const Real quotient = 1 / x;
  const Twofold<Real> product = exact_product(quotient, x);
  return {quotient, ((1 - product.value) - product.low) * quotient};
}

/// a + b without rounding error where |a| ≥ |b| (fast two-sum, Dekker); else to within a last bit of b.
template <class Number>
Twofold<Number> ordered_sum(const Number& a, const Number& b) {
  const Number sum = a + b;
  return {sum, b - (sum - a)};
}

}  // namespace pendula
