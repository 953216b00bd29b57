#pragma once

#include <cmath>
#include <cstddef>
#include <pendula/lanes/lane_pack.hpp>
#include <pendula/numeric/sincos.hpp>

namespace pendula {

namespace detail {

/// function(x) of every member's number, one after the other: what xsimd has of these takes another way for all numbers
/// of a register where one of them asks for it, so that members would see their neighbours.
template <class Register, class Function>
[[gnu::noinline]] LanePack<Register> one_by_one(const LanePack<Register>& x, Function function) {
  alignas(pack_alignment) double numbers[LanePack<Register>::width];
  x.store(numbers);
  for (double& number : numbers) number = function(number);
  return LanePack<Register>::load(numbers);
}

}  // namespace detail

/// The functions that a generated kernel may hold.
#define PENDULA_OF_LANES(name)                                                     \
  template <class Register>                                                        \
  LanePack<Register> name(const LanePack<Register>& x) {                           \
    return detail::one_by_one(x, [](double number) { return std::name(number); }); \
  }
PENDULA_OF_LANES(tan)
PENDULA_OF_LANES(asin)
PENDULA_OF_LANES(acos)
PENDULA_OF_LANES(atan)
PENDULA_OF_LANES(sinh)
PENDULA_OF_LANES(cosh)
PENDULA_OF_LANES(tanh)
PENDULA_OF_LANES(cbrt)
#undef PENDULA_OF_LANES

/// Members far from zero have theirs by the standard library, and others do not notice.
template <class Register>
void sincos(const LanePack<Register>& x, LanePack<Register>& sine, LanePack<Register>& cosine) {
  using L = LanePack<Register>;
  const auto near = abs(x) < L(1e5);
  Register s, c;
  sincos(select(near, x, L(0.0)).held(), s, c);
  sine = L(s);
  cosine = L(c);
  if (xsimd::all(near)) return;
  sine = select(near, sine, detail::one_by_one(x, [](double number) { return std::sin(number); }));
  cosine = select(near, cosine, detail::one_by_one(x, [](double number) { return std::cos(number); }));
}

template <class Register>
LanePack<Register> sin(const LanePack<Register>& x) {
  LanePack<Register> sine, cosine;
  sincos(x, sine, cosine);
  return sine;
}

template <class Register>
LanePack<Register> cos(const LanePack<Register>& x) {
  LanePack<Register> sine, cosine;
  sincos(x, sine, cosine);
  return cosine;
}

template <class Register>
LanePack<Register> pow(const LanePack<Register>& x, const LanePack<Register>& exponent) {
  alignas(pack_alignment) double exponents[LanePack<Register>::width];
  exponent.store(exponents);
  return detail::one_by_one(x, [next = exponents](double number) mutable { return std::pow(number, *next++); });
}

}  // namespace pendula
