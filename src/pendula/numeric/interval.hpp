#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace pendula {

/// A closed interval: all numbers from `low` to `high`. Functions of intervals return enclosures of the exact values
/// and of those computed in doubles.
struct Interval {
  double low = 0, high = 0;

  constexpr Interval() = default;
  constexpr Interval(double number) : low(number), high(number) {}  // NOLINT(google-explicit-constructor)
  constexpr Interval(double from, double to) : low(from), high(to) {}

  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static constexpr Interval all() { return {-infinity, infinity}; }

  double width() const { return high - low; }
  bool is_number() const { return low == high; }
  bool holds(double number) const { return low <= number && number <= high; }
  /// The common sign of all its numbers; 0 where they have none.
  int side() const { return low > 0 ? 1 : high < 0 ? -1 : 0; }

  /// The interval from low to high, each end moved outward by `roundings` epsilons of itself. A NaN end becomes
  /// infinite.
  static Interval rounded(double low, double high, double roundings = 1) {
    constexpr double largest = std::numeric_limits<double>::max();
    const double part = roundings * std::numeric_limits<double>::epsilon();
    if (low == infinity) low = largest;
    if (high == -infinity) high = -largest;
    low -= part * std::abs(low);
    high += part * std::abs(high);
    return {std::isnan(low) ? -infinity : low, std::isnan(high) ? infinity : high};
  }
};

inline Interval hull(const Interval& a, const Interval& b) {
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

/// The intersection, which must not be empty.
inline Interval common(const Interval& a, const Interval& b) {
  return {std::max(a.low, b.low), std::min(a.high, b.high)};
}

inline Interval operator-(const Interval& a) {
  return {-a.high, -a.low};
}
inline Interval operator+(const Interval& a, const Interval& b) {
  return Interval::rounded(a.low + b.low, a.high + b.high);
}
inline Interval operator-(const Interval& a, const Interval& b) {
  return Interval::rounded(a.low - b.high, a.high - b.low);
}
inline Interval operator*(const Interval& a, const Interval& b) {
  const auto product = [](double x, double y) { return x == 0 || y == 0 ? 0.0 : x * y; };
  const auto [low, high] =
      std::minmax({product(a.low, b.low), product(a.low, b.high), product(a.high, b.low), product(a.high, b.high)});
  return Interval::rounded(low, high);
}
inline Interval operator/(const Interval& a, const Interval& b) {
  if (b.low < 0 && b.high > 0) return Interval::all();
  const double low = b.high == 0 ? -Interval::infinity : 1 / b.high;
  const double high = b.low == 0 ? Interval::infinity : 1 / b.low;
  if (a.is_number() && b.is_number()) return Interval::rounded(a.low / b.low, a.low / b.low);
  return a * Interval::rounded(low, high);
}

inline Interval abs(const Interval& x) {
  if (x.low >= 0) return x;
  return x.high <= 0 ? -x : Interval(0, std::max(-x.low, x.high));
}

namespace detail {

/// Enclosure of a monotonically increasing function of the standard library.
template <class Function>
Interval increasing(const Interval& x, Function function) {
  return Interval::rounded(function(x.low), function(x.high), 4);
}

/// Whether x contains a number start + k period, up to rounding.
inline bool holds_one_of(const Interval& x, double start, double period) {
  const double rounding = 4 * std::numeric_limits<double>::epsilon() * (std::max(-x.low, x.high) + period);
  return std::floor((x.high + rounding - start) / period) >= std::ceil((x.low - rounding - start) / period);
}

/// Enclosure of a function of period 2π between −1 and 1, which is 1 at `top` and −1 half a period later.
template <class Function>
Interval periodic(const Interval& x, double top, Function function) {
  constexpr double period = 2 * std::numbers::pi;
  if (!(x.width() < period)) return {-1, 1};
  const auto [low, high] = std::minmax({function(x.low), function(x.high)});
  const Interval ends = Interval::rounded(low, high, 4);
  return {holds_one_of(x, top + std::numbers::pi, period) ? -1 : std::max(ends.low, -1.0),
          holds_one_of(x, top, period) ? 1 : std::min(ends.high, 1.0)};
}

}  // namespace detail

inline Interval sin(const Interval& x) {
  return detail::periodic(x, std::numbers::pi / 2, [](double at) { return std::sin(at); });
}
inline Interval cos(const Interval& x) {
  return detail::periodic(x, 0, [](double at) { return std::cos(at); });
}
inline Interval tan(const Interval& x) {
  constexpr double period = std::numbers::pi;
  if (!(x.width() < period) || detail::holds_one_of(x, period / 2, period)) return Interval::all();
  return detail::increasing(x, [](double at) { return std::tan(at); });
}
inline Interval atan(const Interval& x) {
  return detail::increasing(x, [](double at) { return std::atan(at); });
}
inline Interval sinh(const Interval& x) {
  return detail::increasing(x, [](double at) { return std::sinh(at); });
}
inline Interval cosh(const Interval& x) {
  return detail::increasing(abs(x), [](double at) { return std::cosh(at); });
}
inline Interval tanh(const Interval& x) {
  return common(detail::increasing(x, [](double at) { return std::tanh(at); }), {-1, 1});
}
inline Interval exp(const Interval& x) {
  return detail::increasing(x, [](double at) { return std::exp(at); });
}
/// The root of the non-negative part of x, which must not be empty.
inline Interval sqrt(const Interval& x) {
  return detail::increasing({std::max(x.low, 0.0), x.high}, [](double at) { return std::sqrt(at); });
}
inline Interval log(const Interval& x) {
  return detail::increasing({std::max(x.low, 0.0), x.high}, [](double at) { return std::log(at); });
}
/// The arcsine of the part of x in [−1, 1], which must not be empty.
inline Interval asin(const Interval& x) {
  return detail::increasing(common(x, {-1, 1}), [](double at) { return std::asin(at); });
}
inline Interval acos(const Interval& x) {
  return -detail::increasing(common(x, {-1, 1}), [](double at) { return -std::acos(at); });
}

/// x to a constant exponent. Either the exponent is a whole number, or x is not negative.
inline Interval pow(const Interval& x, double exponent) {
  const auto power = [=](double at) { return std::pow(at, exponent); };
  if (exponent == 0) return 1;
  if (exponent < 0) return 1 / pow(x, -exponent);
  if (x.low >= 0 || std::fmod(exponent, 2) != 0) return detail::increasing(x, power);
  return detail::increasing(abs(x), power);
}

}  // namespace pendula
