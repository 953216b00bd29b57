#pragma once

#include <pendula/lanes/lane_dual.hpp>
#include <pendula/lanes/lane_functions.hpp>

namespace pendula {

namespace detail {

/// f(x) of value f and slope f'.
template <class L>
LaneDual<L> chained(const L& f, const L& slope, const LaneDual<L>& x) {
  return {f, slope * x.slope};
}

}  // namespace detail

/// The functions that a generated kernel may hold, with their derivatives along a tangent.
template <class L>
void sincos(const LaneDual<L>& x, LaneDual<L>& sine, LaneDual<L>& cosine) {
  L s, c;
  sincos(x.value, s, c);
  sine = detail::chained(s, c, x);
  cosine = detail::chained(c, -s, x);
}
template <class L>
LaneDual<L> sin(const LaneDual<L>& x) {
  LaneDual<L> sine, cosine;
  sincos(x, sine, cosine);
  return sine;
}
template <class L>
LaneDual<L> cos(const LaneDual<L>& x) {
  LaneDual<L> sine, cosine;
  sincos(x, sine, cosine);
  return cosine;
}
template <class L>
LaneDual<L> tan(const LaneDual<L>& x) {
  const L f = tan(x.value);
  return detail::chained(f, fma(f, f, L(1.0)), x);
}
template <class L>
LaneDual<L> asin(const LaneDual<L>& x) {
  return detail::chained(asin(x.value), L(1.0) / sqrt(fma(-x.value, x.value, L(1.0))), x);
}
template <class L>
LaneDual<L> acos(const LaneDual<L>& x) {
  return detail::chained(acos(x.value), L(-1.0) / sqrt(fma(-x.value, x.value, L(1.0))), x);
}
template <class L>
LaneDual<L> atan(const LaneDual<L>& x) {
  return detail::chained(atan(x.value), L(1.0) / fma(x.value, x.value, L(1.0)), x);
}
template <class L>
LaneDual<L> sinh(const LaneDual<L>& x) {
  return detail::chained(sinh(x.value), cosh(x.value), x);
}
template <class L>
LaneDual<L> cosh(const LaneDual<L>& x) {
  return detail::chained(cosh(x.value), sinh(x.value), x);
}
template <class L>
LaneDual<L> tanh(const LaneDual<L>& x) {
  const L f = tanh(x.value);
  return detail::chained(f, fma(-f, f, L(1.0)), x);
}
template <class L>
LaneDual<L> exp(const LaneDual<L>& x) {
  const L f = exp(x.value);
  return detail::chained(f, f, x);
}
template <class L>
LaneDual<L> log(const LaneDual<L>& x) {
  return detail::chained(log(x.value), L(1.0) / x.value, x);
}
template <class L>
LaneDual<L> sqrt(const LaneDual<L>& x) {
  const L f = sqrt(x.value);
  return detail::chained(f, L(0.5) / f, x);
}
template <class L>
LaneDual<L> cbrt(const LaneDual<L>& x) {
  const L f = cbrt(x.value);
  return detail::chained(f, L(1.0) / (3.0 * (f * f)), x);
}
/// Of a constant exponent, which is all that kernels have.
template <class L>
LaneDual<L> pow(const LaneDual<L>& x, const LaneDual<L>& exponent) {
  const L& p = exponent.value;
  return detail::chained(pow(x.value, p), p * pow(x.value, p - L(1.0)), x);
}

}  // namespace pendula
