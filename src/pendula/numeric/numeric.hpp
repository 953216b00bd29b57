#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <pendula/numeric/fast_fma.hpp>

/// Functions by which one source serves both a plain number (one motion) and a LanePack (several members): a plain
/// number is a pack of one. For packs the same names are friend functions, found by argument-dependent lookup.
namespace pendula {

namespace detail {

/// Used in place of zero in logarithms and divisors.
inline constexpr double almost_zero = 1e-300;

}  // namespace detail

template <class L>
struct Dual;

/// Types that belong to a number. Mask: a bool for each member; for one motion a plain bool.
template <class Num>
struct Numeric {
  using Mask = typename Num::Mask;
  using Constant = Num;  ///< the number without a derivative
  static constexpr bool is_batch = true;
};
template <std::floating_point Real>
struct Numeric<Real> {
  using Mask = bool;
  using Constant = Real;
  static constexpr bool is_batch = false;
};
template <class L>
struct Numeric<Dual<L>> : Numeric<L> {};

/// MaskOf<Num>(true) is true for all members.
template <class Num>
using MaskOf = typename Numeric<Num>::Mask;
template <class Num>
using ConstantOf = typename Numeric<Num>::Constant;
template <class Num>
inline constexpr bool is_batch = Numeric<Num>::is_batch;

inline bool any(bool mask) {
  return mask;
}
inline bool all(bool mask) {
  return mask;
}

template <std::floating_point Real>
Real select(bool which, const Real& yes, const Real& no) {
  return which ? yes : no;
}

// Like SIMD registers: b where either is NaN.
template <std::floating_point Real>
Real max(const Real& a, const Real& b) {
  return a > b ? a : b;
}
template <std::floating_point Real>
Real min(const Real& a, const Real& b) {
  return a < b ? a : b;
}

/// For plain numbers: LanePack has the reason.
template <std::floating_point Real>
Real in_register(const Real& a) {
  return a;
}

/// a b + c, with one rounding where the processor has a fast fused multiply-add.
template <std::floating_point Real>
Real fma(const Real& a, const Real& b, const Real& c) {
  if constexpr (detail::has_fast_fma<Real>) {
    return std::fma(a, b, c);
  } else {
    return a * b + c;
  }
}

namespace detail {

/// log₂ of the mantissa m of a number, 1 ≤ m < 2, to 7e-4.
template <class Num>
Num log2_of_mantissa(const Num& m) {
  return ((Num(0.158248749) * m + Num(-1.051875031)) * m + Num(3.047884161)) * m + Num(-2.153620718);
}

}  // namespace detail

/// log₂ x of a positive normal number, to 7e-4: for the sizes of steps.
inline double log2_near(double x) {
  const auto bits = std::bit_cast<std::uint64_t>(x);
  const double mantissa = std::bit_cast<double>((bits & ((std::uint64_t{1} << 52) - 1)) | std::uint64_t{1023} << 52);
  return static_cast<double>(static_cast<int>(bits >> 52) - 1023) + detail::log2_of_mantissa(mantissa);
}

using std::abs;
using std::exp;
using std::floor;
using std::log;
using std::sqrt;

/// The number of one member; a plain number is that of the only one.
template <std::floating_point Real>
Real get(const Real& x, int /*member*/) {
  return x;
}
template <std::floating_point Real>
void set(Real& x, int /*member*/, double value) {
  x = static_cast<Real>(value);
}
template <class Num>
requires(is_batch<Num>) double get(const Num& x, int member) {
  return x[member];
}
template <class Num>
requires(is_batch<Num>) void set(Num& x, int member, double value) {
  x.set(member, value);
}

}  // namespace pendula
