#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace pendula {

/// A number with its derivatives in `Count` directions: generated kernels, computed in it, give theirs, exactly.
template <int Count>
struct Dual {
  double value = 0;
  std::array<double, static_cast<std::size_t>(Count)> slopes{};

  Dual() = default;
  explicit Dual(double number) : value(number) {}

  friend Dual operator+(const Dual& a, const Dual& b) { return combined(a.value + b.value, 1, a, 1, b); }
  friend Dual operator-(const Dual& a, const Dual& b) { return combined(a.value - b.value, 1, a, -1, b); }
  friend Dual operator*(const Dual& a, const Dual& b) { return combined(a.value * b.value, b.value, a, a.value, b); }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const double ratio = a.value / b.value;
    return combined(ratio, 1 / b.value, a, -ratio / b.value, b);
  }
  friend Dual operator-(const Dual& a) { return chained(-a.value, -1, a); }
  Dual& operator+=(const Dual& b) { return *this = *this + b; }
  Dual& operator-=(const Dual& b) { return *this = *this - b; }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }
  Dual& operator/=(const Dual& b) { return *this = *this / b; }

  /// f(x) of value f and slope f'.
  static Dual chained(double f, double slope, const Dual& x) {
    Dual result(f);
    for (std::size_t k = 0; k < result.slopes.size(); ++k) result.slopes[k] = slope * x.slopes[k];
    return result;
  }

 private:
  static Dual combined(double value, double of_a, const Dual& a, double of_b, const Dual& b) {
    Dual result(value);
    for (std::size_t k = 0; k < result.slopes.size(); ++k) {
      result.slopes[k] = of_a * a.slopes[k] + of_b * b.slopes[k];
    }
    return result;
  }
};

/// The functions that a generated kernel may hold.
template <int Count>
Dual<Count> sin(const Dual<Count>& x) {
  return Dual<Count>::chained(std::sin(x.value), std::cos(x.value), x);
}
template <int Count>
Dual<Count> cos(const Dual<Count>& x) {
  return Dual<Count>::chained(std::cos(x.value), -std::sin(x.value), x);
}
template <int Count>
Dual<Count> tan(const Dual<Count>& x) {
  const double f = std::tan(x.value);
  return Dual<Count>::chained(f, 1 + f * f, x);
}
template <int Count>
Dual<Count> asin(const Dual<Count>& x) {
  return Dual<Count>::chained(std::asin(x.value), 1 / std::sqrt(1 - x.value * x.value), x);
}
template <int Count>
Dual<Count> acos(const Dual<Count>& x) {
  return Dual<Count>::chained(std::acos(x.value), -1 / std::sqrt(1 - x.value * x.value), x);
}
template <int Count>
Dual<Count> atan(const Dual<Count>& x) {
  return Dual<Count>::chained(std::atan(x.value), 1 / (1 + x.value * x.value), x);
}
template <int Count>
Dual<Count> sinh(const Dual<Count>& x) {
  return Dual<Count>::chained(std::sinh(x.value), std::cosh(x.value), x);
}
template <int Count>
Dual<Count> cosh(const Dual<Count>& x) {
  return Dual<Count>::chained(std::cosh(x.value), std::sinh(x.value), x);
}
template <int Count>
Dual<Count> tanh(const Dual<Count>& x) {
  const double f = std::tanh(x.value);
  return Dual<Count>::chained(f, 1 - f * f, x);
}
template <int Count>
Dual<Count> exp(const Dual<Count>& x) {
  const double f = std::exp(x.value);
  return Dual<Count>::chained(f, f, x);
}
template <int Count>
Dual<Count> log(const Dual<Count>& x) {
  return Dual<Count>::chained(std::log(x.value), 1 / x.value, x);
}
template <int Count>
Dual<Count> sqrt(const Dual<Count>& x) {
  const double f = std::sqrt(x.value);
  return Dual<Count>::chained(f, 0.5 / f, x);
}
template <int Count>
Dual<Count> cbrt(const Dual<Count>& x) {
  const double f = std::cbrt(x.value);
  return Dual<Count>::chained(f, 1 / (3 * f * f), x);
}
/// Of a constant exponent, which is all that kernels have.
template <int Count>
Dual<Count> pow(const Dual<Count>& x, const Dual<Count>& exponent) {
  const double p = exponent.value;
  return Dual<Count>::chained(std::pow(x.value, p), p * std::pow(x.value, p - 1), x);
}

}  // namespace pendula
