#pragma once

#include <cmath>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/sincos.hpp>

namespace pendula {

namespace detail {

/// f(x) by the chain rule, from the value f and the derivative `slope` of f at x.value.
template <class L>
Dual<L> chained(const L& f, const L& slope, const Dual<L>& x) {
  return {f, slope * x.slope};
}

}  // namespace detail

/// The functions that a generated kernel may call, with their derivatives.
template <class L>
void sincos(const Dual<L>& x, Dual<L>& sine, Dual<L>& cosine) {
  L s, c;
  sincos(x.value, s, c);
  sine = detail::chained(s, c, x);
  cosine = detail::chained(c, -s, x);
}
template <class L>
Dual<L> sin(const Dual<L>& x) {
  Dual<L> sine, cosine;
  sincos(x, sine, cosine);
  return sine;
}
template <class L>
Dual<L> cos(const Dual<L>& x) {
  Dual<L> sine, cosine;
  sincos(x, sine, cosine);
  return cosine;
}
template <class L>
Dual<L> tan(const Dual<L>& x) {
  using std::tan;
  const L f = tan(x.value);
  return detail::chained(f, detail::sum_of_product(f, f, L(1.0)), x);
}
template <class L>
Dual<L> asin(const Dual<L>& x) {
  using std::asin, std::sqrt;
  return detail::chained<L>(asin(x.value), L(1.0) / sqrt(detail::sum_of_product(-x.value, x.value, L(1.0))), x);
}
template <class L>
Dual<L> acos(const Dual<L>& x) {
  using std::acos, std::sqrt;
  return detail::chained<L>(acos(x.value), L(-1.0) / sqrt(detail::sum_of_product(-x.value, x.value, L(1.0))), x);
}
template <class L>
Dual<L> atan(const Dual<L>& x) {
  using std::atan;
  return detail::chained<L>(atan(x.value), L(1.0) / detail::sum_of_product(x.value, x.value, L(1.0)), x);
}
template <class L>
Dual<L> sinh(const Dual<L>& x) {
  using std::cosh, std::sinh;
  return detail::chained<L>(sinh(x.value), cosh(x.value), x);
}
template <class L>
Dual<L> cosh(const Dual<L>& x) {
  using std::cosh, std::sinh;
  return detail::chained<L>(cosh(x.value), sinh(x.value), x);
}
template <class L>
Dual<L> tanh(const Dual<L>& x) {
  using std::tanh;
  const L f = tanh(x.value);
  return detail::chained(f, detail::sum_of_product(-f, f, L(1.0)), x);
}
template <class L>
Dual<L> exp(const Dual<L>& x) {
  using std::exp;
  const L f = exp(x.value);
  return detail::chained(f, f, x);
}
template <class L>
Dual<L> log(const Dual<L>& x) {
  using std::log;
  return detail::chained<L>(log(x.value), L(1.0) / x.value, x);
}
template <class L>
Dual<L> sqrt(const Dual<L>& x) {
  using std::sqrt;
  const L f = sqrt(x.value);
  return detail::chained<L>(f, L(0.5) / f, x);
}
template <class L>
Dual<L> cbrt(const Dual<L>& x) {
  using std::cbrt;
  const L f = cbrt(x.value);
  return detail::chained<L>(f, L(1.0) / (L(3.0) * (f * f)), x);
}
/// For constant exponents only: kernels have no others.
template <class L>
Dual<L> pow(const Dual<L>& x, const Dual<L>& exponent) {
  using std::pow;
  const L& p = exponent.value;
  return detail::chained<L>(pow(x.value, p), p * pow(x.value, p - L(1.0)), x);
}

}  // namespace pendula
