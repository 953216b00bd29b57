#pragma once

#include <cmath>
#include <cstddef>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/sincos.hpp>
#include <xsimd/xsimd.hpp>

namespace pendula {

namespace detail {

/// function(x) of each number of a pack, computed one by one. xsimd's versions of these functions choose a branch for
/// the whole register, so that the result for one member of an ensemble would depend on its neighbours.
template <int Size, class Register, class Function>
[[gnu::noinline]] Pack<Size, Register> one_by_one(const Pack<Size, Register>& x, Function function) {
  alignas(pack_alignment) typename Pack<Size, Register>::Scalar numbers[static_cast<std::size_t>(Size)];
  x.store(numbers);
  for (auto& number : numbers) number = function(number);
  return Pack<Size, Register>::load(numbers);
}

}  // namespace detail

/// The functions that a generated kernel may call, for packs.
#define PENDULA_ONE_BY_ONE(function)                             \
  template <int Size, class Register>                            \
  Pack<Size, Register> function(const Pack<Size, Register>& x) { \
    return detail::one_by_one(x, [](const auto& number) {        \
      using std::function;                                       \
      return function(number);                                   \
    });                                                          \
  }
PENDULA_ONE_BY_ONE(tan)
PENDULA_ONE_BY_ONE(asin)
PENDULA_ONE_BY_ONE(acos)
PENDULA_ONE_BY_ONE(atan)
PENDULA_ONE_BY_ONE(sinh)
PENDULA_ONE_BY_ONE(cosh)
PENDULA_ONE_BY_ONE(tanh)
PENDULA_ONE_BY_ONE(cbrt)
#undef PENDULA_ONE_BY_ONE

#define PENDULA_OF_REGISTERS(function)                           \
  template <int Size, class Register>                            \
  Pack<Size, Register> function(const Pack<Size, Register>& x) { \
    return mapped(                                               \
        [](const Register& at) -> Register {                     \
          using std::function, xsimd::function;                  \
          return function(at);                                   \
        },                                                       \
        x);                                                      \
  }
PENDULA_OF_REGISTERS(exp)
PENDULA_OF_REGISTERS(log)
PENDULA_OF_REGISTERS(sqrt)
#undef PENDULA_OF_REGISTERS

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
  alignas(pack_alignment) typename Pack<Size, Register>::Scalar exponents[static_cast<std::size_t>(Size)];
  exponent.store(exponents);
  return detail::one_by_one(x, [next = exponents](const auto& number) mutable {
    using std::pow;
    return pow(number, *next++);
  });
}

}  // namespace pendula
