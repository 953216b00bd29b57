#pragma once

#include <cmath>
#include <concepts>
#include <pendula/numeric/fast_fma.hpp>

/// What text needs that is written once for a number of one motion, a plain one, and for a number of several members,
/// a LanePack: a plain number is a pack of one. Of packs the same names are friends, found by their arguments.
namespace pendula {

template <class L>
struct Dual;

/// What belongs to a number: of several members a yes or no for each; of one motion a bool.
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

/// MaskOf<Num>(true): all of them.
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

// As registers do it: the second where either is no number.
template <std::floating_point Real>
Real max(const Real& a, const Real& b) {
  return a > b ? a : b;
}
template <std::floating_point Real>
Real min(const Real& a, const Real& b) {
  return a < b ? a : b;
}

/// a b + c, rounded once where the processor does that fast.
template <std::floating_point Real>
Real fma(const Real& a, const Real& b, const Real& c) {
  if constexpr (detail::has_fast_fma<Real>) {
    return std::fma(a, b, c);
  } else {
    return a * b + c;
  }
}

using std::abs;
using std::exp;
using std::floor;
using std::log;
using std::sqrt;

/// One member's number; of one motion there is but one.
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
