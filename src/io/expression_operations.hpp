#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/numeric/reach.hpp>

#include "io/expression_program.hpp"

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

/// Applies an operation to doubles or to Reach.
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
