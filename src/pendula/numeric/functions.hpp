#pragma once

#include <cmath>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/sincos.hpp>
#include <xsimd/xsimd.hpp>

namespace pendula {

/// The functions that a generated kernel may hold, of every number of a pack.
#define PENDULA_OF_PACKS(function)                               \
  template <int Size, class Register>                            \
  Pack<Size, Register> function(const Pack<Size, Register>& x) { \
    return mapped(                                               \
        [](const Register& at) -> Register {                     \
          using std::function, xsimd::function;                  \
          return function(at);                                   \
        },                                                       \
        x);                                                      \
  }
PENDULA_OF_PACKS(tan)
PENDULA_OF_PACKS(asin)
PENDULA_OF_PACKS(acos)
PENDULA_OF_PACKS(atan)
PENDULA_OF_PACKS(sinh)
PENDULA_OF_PACKS(cosh)
PENDULA_OF_PACKS(tanh)
PENDULA_OF_PACKS(exp)
PENDULA_OF_PACKS(log)
PENDULA_OF_PACKS(sqrt)
PENDULA_OF_PACKS(cbrt)
#undef PENDULA_OF_PACKS

template <int Size, class Register>
Pack<Size, Register> sin(const Pack<Size, Register>& x) {
  Pack<Size, Register> sine, cosine;
  sincos(x, sine, cosine);
  return sine;
}

template <int Size, class Register>
Pack<Size, Register> cos(const Pack<Size, Register>& x) {
  Pack<Size, Register> sine, cosine;
  sincos(x, sine, cosine);
  return cosine;
}

template <int Size, class Register>
Pack<Size, Register> pow(const Pack<Size, Register>& x, const Pack<Size, Register>& exponent) {
  return exp(exponent * log(x));
}

}  // namespace pendula
