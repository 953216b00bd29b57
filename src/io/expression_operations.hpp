#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/dual_functions.hpp>
#include <pendula/numeric/reach.hpp>

#include "io/expression_program.hpp"

namespace pendula {

// Functions of dual numbers that expressions have, and kernels do not.
inline Dual<double> floor(const Dual<double>& x) {
  return Dual<double>(std::floor(x.value));
}
inline Dual<double> abs(const Dual<double>& x) {
  return x.value < 0 ? -x : x;
}
inline Dual<double> atan2(const Dual<double>& y, const Dual<double>& x) {
  const double squared = x.value * x.value + y.value * y.value;
  return {std::atan2(y.value, x.value), (x.value * y.slope - y.value * x.slope) / squared};
}
inline Dual<double> fmod(const Dual<double>& a, const Dual<double>& b) {
  return {std::fmod(a.value, b.value), a.slope - std::trunc(a.value / b.value) * b.slope};
}
inline Dual<double> pow(const Dual<double>& x, const Dual<double>& exponent) {
  const double power = std::pow(x.value, exponent.value);
  double slope = x.slope == 0 ? 0 : exponent.value * std::pow(x.value, exponent.value - 1) * x.slope;
  if (exponent.slope != 0) slope += std::log(x.value) * power * exponent.slope;
  return {power, slope};
}
inline Dual<double> log2(const Dual<double>& x) {
  return {std::log2(x.value), x.slope / (x.value * std::numbers::ln2)};
}
inline Dual<double> log10(const Dual<double>& x) {
  return {std::log10(x.value), x.slope / (x.value * std::numbers::ln10)};
}

}  // namespace pendula

namespace pendula::io::detail {

// Functions of doubles that Reach has, too.
inline double sign(double x) {
  return x > 0 ? 1 : x < 0 ? -1 : 0;
}
inline double rint(double x) {
  return std::floor(x + 0.5);
}
inline double min(double a, double b) {
  return std::min(a, b);
}
inline double max(double a, double b) {
  return std::max(a, b);
}
inline double less(double a, double b) {
  return a < b ? 1 : 0;
}
inline double at_most(double a, double b) {
  return a <= b ? 1 : 0;
}
inline double equal(double a, double b) {
  return a == b ? 1 : 0;
}
inline double unequal(double a, double b) {
  return a != b ? 1 : 0;
}
inline double both(double a, double b) {
  return a != 0 && b != 0 ? 1 : 0;
}
inline double either(double a, double b) {
  return a != 0 || b != 0 ? 1 : 0;
}
inline double choose(double condition, double yes, double no) {
  return condition != 0 ? yes : no;
}

// The same of dual numbers: what jumps has no slope.
using Slope = Dual<double>;

inline Slope without_slope(double value) {
  return Slope(value);
}
inline Slope sign(const Slope& x) {
  return without_slope(sign(x.value));
}
inline Slope rint(const Slope& x) {
  return without_slope(rint(x.value));
}
inline Slope min(const Slope& a, const Slope& b) {
  return b.value < a.value ? b : a;
}
inline Slope max(const Slope& a, const Slope& b) {
  return a.value < b.value ? b : a;
}
inline Slope less(const Slope& a, const Slope& b) {
  return without_slope(less(a.value, b.value));
}
inline Slope at_most(const Slope& a, const Slope& b) {
  return without_slope(at_most(a.value, b.value));
}
inline Slope equal(const Slope& a, const Slope& b) {
  return without_slope(equal(a.value, b.value));
}
inline Slope unequal(const Slope& a, const Slope& b) {
  return without_slope(unequal(a.value, b.value));
}
inline Slope both(const Slope& a, const Slope& b) {
  return without_slope(both(a.value, b.value));
}
inline Slope either(const Slope& a, const Slope& b) {
  return without_slope(either(a.value, b.value));
}
inline Slope choose(const Slope& condition, const Slope& yes, const Slope& no) {
  return condition.value != 0 ? yes : no;
}

/// Applies an operation to doubles, to Reach or to Slope.
template <class Number>
Number applied(Operation operation, const Number& a, const Number& b, const Number& c) {
  using std::sin, std::cos, std::tan, std::asin, std::acos, std::atan, std::atan2, std::sinh, std::cosh, std::tanh,
      std::exp, std::log, std::log2, std::log10, std::sqrt, std::abs, std::floor, std::fmod, std::pow;
  switch (operation) {
    case Operation::negative:
      return -a;
    case Operation::sum:
      return a + b;
    case Operation::difference:
      return a - b;
    case Operation::product:
      return a * b;
    case Operation::ratio:
      return a / b;
    case Operation::power:
      return pow(a, b);
    case Operation::less:
      return less(a, b);
    case Operation::greater:
      return less(b, a);
    case Operation::at_most:
      return at_most(a, b);
    case Operation::at_least:
      return at_most(b, a);
    case Operation::equal:
      return equal(a, b);
    case Operation::unequal:
      return unequal(a, b);
    case Operation::both:
      return both(a, b);
    case Operation::either:
      return either(a, b);
    case Operation::choose:
      return choose(a, b, c);
    case Operation::sine:
      return sin(a);
    case Operation::cosine:
      return cos(a);
    case Operation::tangent:
      return tan(a);
    case Operation::arcsine:
      return asin(a);
    case Operation::arccosine:
      return acos(a);
    case Operation::arctangent:
      return atan(a);
    case Operation::arctangent2:
      return atan2(a, b);
    case Operation::hyperbolic_sine:
      return sinh(a);
    case Operation::hyperbolic_cosine:
      return cosh(a);
    case Operation::hyperbolic_tangent:
      return tanh(a);
    case Operation::exponential:
      return exp(a);
    case Operation::logarithm:
      return log(a);
    case Operation::logarithm2:
      return log2(a);
    case Operation::logarithm10:
      return log10(a);
    case Operation::root:
      return sqrt(a);
    case Operation::size:
      return abs(a);
    case Operation::sign:
      return sign(a);
    case Operation::rint:
      return rint(a);
    case Operation::floor:
      return floor(a);
    case Operation::remainder:
      return fmod(a, b);
    case Operation::least:
      return min(a, b);
    case Operation::largest:
      return max(a, b);
    case Operation::constant:
    case Operation::column:
      break;
  }
  return a;
}

}  // namespace pendula::io::detail
