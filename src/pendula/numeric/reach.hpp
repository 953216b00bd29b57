#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <pendula/numeric/interval.hpp>

namespace pendula {

/// Enclosures of a function of time and of its derivative over an interval of time. Functions of reaches return
/// reaches; where a function may jump, its derivative is unbounded.
struct Reach {
  /// Where the function has a value.
  enum class Defined { everywhere, partly, nowhere };

  Interval value, slope = Interval::all();
  Defined defined = Defined::everywhere;

  Reach() = default;
  explicit Reach(double number) : value(number), slope(0) {}
  Reach(const Interval& values, const Interval& slopes) : value(values), slope(slopes) {}

  bool is_number() const { return value.is_number() && slope.is_number() && defined == Defined::everywhere; }

  /// This one, defined only where all of `given` are defined, too.
  template <class... Reaches>
  Reach where(const Reaches&... given) const {
    Reach reach = *this;
    reach.defined = std::max({defined, given.defined...});
    return reach.defined == Defined::everywhere ? reach : unknown(reach.defined);
  }

  static Reach unknown(Defined where) {
    Reach reach(Interval::all(), Interval::all());
    reach.defined = where;
    return reach;
  }
};

namespace detail {

/// f(x) by the chain rule, from the enclosures of f and of its derivative over the values of x.
inline Reach composed(const Interval& f, const Interval& derivative, const Reach& x) {
  return Reach(f, derivative * x.slope).where(x);
}

/// f(x) for an f that is defined from `least` to `most` only.
template <class Function>
Reach within(double least, double most, const Reach& x, Function function) {
  if (x.value.high < least || x.value.low > most) return Reach::unknown(Reach::Defined::nowhere).where(x);
  if (x.value.low < least || x.value.high > most) return Reach::unknown(Reach::Defined::partly).where(x);
  return function();
}

/// A step function: piecewise constant, non-decreasing.
template <class Function>
Reach step_function(const Reach& x, Function function) {
  const Interval values{function(x.value.low), function(x.value.high)};
  return Reach(values, values.is_number() ? Interval(0) : Interval::all()).where(x);
}

inline bool has_value(const Reach& x) {
  return x.defined == Reach::Defined::everywhere;
}

/// The reach of a condition: 0, 1, or either.
inline Reach truth(bool may_be, bool must_be) {
  return Reach({must_be ? 1.0 : 0.0, may_be ? 1.0 : 0.0}, may_be == must_be ? Interval(0) : Interval::all());
}
inline Reach compared(const Reach& a, const Reach& b, bool may_be, bool must_be) {
  return has_value(a) && has_value(b) ? truth(may_be, must_be) : truth(true, false);
}

inline bool may_be_true(const Reach& x) {
  return x.value.low != 0 || x.value.high != 0;
}
inline bool must_be_true(const Reach& x) {
  return has_value(x) && !x.value.holds(0);
}

}  // namespace detail

inline Reach operator-(const Reach& a) {
  return Reach(-a.value, -a.slope).where(a);
}
inline Reach operator+(const Reach& a, const Reach& b) {
  return Reach(a.value + b.value, a.slope + b.slope).where(a, b);
}
inline Reach operator-(const Reach& a, const Reach& b) {
  return Reach(a.value - b.value, a.slope - b.slope).where(a, b);
}
inline Reach operator*(const Reach& a, const Reach& b) {
  return Reach(a.value * b.value, a.slope * b.value + a.value * b.slope).where(a, b);
}
inline Reach operator/(const Reach& a, const Reach& b) {
  if (b.value.low == 0 && b.value.high == 0) return Reach::unknown(Reach::Defined::nowhere).where(a, b);
  const Interval ratio = a.value / b.value;
  return Reach(ratio, (a.slope - ratio * b.slope) / b.value).where(a, b);
}

inline Reach sin(const Reach& x) {
  return detail::composed(sin(x.value), cos(x.value), x);
}
inline Reach cos(const Reach& x) {
  return detail::composed(cos(x.value), -sin(x.value), x);
}
inline Reach tan(const Reach& x) {
  const Interval f = tan(x.value);
  return detail::composed(f, f.width() < Interval::infinity ? 1 + pow(f, 2) : Interval::all(), x);
}
inline Reach asin(const Reach& x) {
  return detail::within(-1, 1, x, [&] { return detail::composed(asin(x.value), 1 / sqrt(1 - pow(x.value, 2)), x); });
}
inline Reach acos(const Reach& x) {
  return detail::within(-1, 1, x, [&] { return detail::composed(acos(x.value), -1 / sqrt(1 - pow(x.value, 2)), x); });
}
inline Reach atan(const Reach& x) {
  return detail::composed(atan(x.value), 1 / (1 + pow(x.value, 2)), x);
}
inline Reach sinh(const Reach& x) {
  return detail::composed(sinh(x.value), cosh(x.value), x);
}
inline Reach cosh(const Reach& x) {
  return detail::composed(cosh(x.value), sinh(x.value), x);
}
inline Reach tanh(const Reach& x) {
  const Interval f = tanh(x.value);
  return detail::composed(f, abs(1 - pow(f, 2)), x);
}
inline Reach exp(const Reach& x) {
  const Interval f = exp(x.value);
  return detail::composed(f, f, x);
}
inline Reach sqrt(const Reach& x) {
  return detail::within(0, Interval::infinity, x, [&] {
    const Interval f = sqrt(x.value);
    return detail::composed(f, 0.5 / f, x);
  });
}
inline Reach log(const Reach& x) {
  return detail::within(0, Interval::infinity, x, [&] { return detail::composed(log(x.value), 1 / x.value, x); });
}
inline Reach log2(const Reach& x) {
  return log(x) / Reach(std::numbers::ln2);
}
inline Reach log10(const Reach& x) {
  return log(x) / Reach(std::numbers::ln10);
}

inline Reach abs(const Reach& x) {
  const Interval derivative(x.value.low >= 0 ? 1 : -1, x.value.high <= 0 ? -1 : 1);
  return detail::composed(abs(x.value), derivative, x);
}
inline Reach min(const Reach& a, const Reach& b) {
  if (a.value.high <= b.value.low) return a.where(b);
  if (b.value.high <= a.value.low) return b.where(a);
  const Interval least{std::min(a.value.low, b.value.low), std::min(a.value.high, b.value.high)};
  return Reach(least, hull(a.slope, b.slope)).where(a, b);
}
inline Reach max(const Reach& a, const Reach& b) {
  return -min(-a, -b);
}
inline Reach floor(const Reach& x) {
  return detail::step_function(x, [](double at) { return std::floor(at); });
}
inline Reach rint(const Reach& x) {
  return detail::step_function(x, [](double at) { return std::floor(at + 0.5); });
}
inline Reach sign(const Reach& x) {
  return detail::step_function(x, [](double at) { return at > 0 ? 1.0 : at < 0 ? -1.0 : 0.0; });
}

/// Exact where the divisor is a number and the remainder does not jump.
inline Reach fmod(const Reach& x, const Reach& divisor) {
  const double size = std::max(std::abs(divisor.value.low), std::abs(divisor.value.high));
  if (size == 0) return Reach::unknown(Reach::Defined::nowhere).where(x, divisor);
  if (divisor.is_number() && x.value.width() < size) {
    const Interval ends{std::fmod(x.value.low, size), std::fmod(x.value.high, size)};
    if (ends.width() == x.value.width()) return Reach(ends, x.slope).where(x);
  }
  return Reach({x.value.low < 0 ? -size : 0, x.value.high > 0 ? size : 0}, Interval::all()).where(x, divisor);
}

inline Reach atan2(const Reach& y, const Reach& x) {
  const bool is_cut = y.value.holds(0) && x.value.low <= 0;
  if (is_cut) return Reach({-std::numbers::pi, std::numbers::pi}, Interval::all()).where(y, x);
  // atan2 is monotone in x and in y: its extremes are at corners.
  const auto [low, high] = std::minmax({std::atan2(y.value.low, x.value.low), std::atan2(y.value.low, x.value.high),
                                        std::atan2(y.value.high, x.value.low), std::atan2(y.value.high, x.value.high)});
  const Interval slope = (x.value * y.slope - y.value * x.slope) / (pow(x.value, 2) + pow(y.value, 2));
  return Reach(Interval::rounded(low, high, 4), slope).where(y, x);
}

inline Reach pow(const Reach& x, const Reach& exponent) {
  if (!exponent.is_number()) {
    return detail::within(0, Interval::infinity, x, [&] { return exp(exponent * log(x)); });
  }
  const double n = exponent.value.low;
  const auto power = [&] { return detail::composed(pow(x.value, n), n == 0 ? 0 : n * pow(x.value, n - 1), x); };
  return n == std::floor(n) ? power() : detail::within(0, Interval::infinity, x, power);
}

// --- Conditions: 1 where true, 0 where false; comparisons with an undefined value are false ---

inline Reach less(const Reach& a, const Reach& b) {
  return detail::compared(a, b, a.value.low < b.value.high, a.value.high < b.value.low);
}
inline Reach at_most(const Reach& a, const Reach& b) {
  return detail::compared(a, b, a.value.low <= b.value.high, a.value.high <= b.value.low);
}
inline Reach equal(const Reach& a, const Reach& b) {
  const bool meet = a.value.low <= b.value.high && b.value.low <= a.value.high;
  return detail::compared(a, b, meet, meet && a.value.is_number() && b.value.is_number());
}
inline Reach unequal(const Reach& a, const Reach& b) {
  const bool meet = a.value.low <= b.value.high && b.value.low <= a.value.high;
  return detail::compared(a, b, !(meet && a.value.is_number() && b.value.is_number()), !meet);
}
inline Reach both(const Reach& a, const Reach& b) {
  return detail::truth(detail::may_be_true(a) && detail::may_be_true(b),
                       detail::must_be_true(a) && detail::must_be_true(b));
}
inline Reach either(const Reach& a, const Reach& b) {
  return detail::truth(detail::may_be_true(a) || detail::may_be_true(b),
                       detail::must_be_true(a) || detail::must_be_true(b));
}
/// `yes` where `condition` is not 0, else `no`.
inline Reach choose(const Reach& condition, const Reach& yes, const Reach& no) {
  if (detail::must_be_true(condition)) return yes;
  if (!detail::may_be_true(condition)) return no;
  return Reach(hull(yes.value, no.value), Interval::all()).where(yes, no);
}

}  // namespace pendula
