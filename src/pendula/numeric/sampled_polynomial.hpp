#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <pendula/numeric/interval.hpp>
#include <utility>

namespace pendula {

/// Position in [0, 1] of sample 0 to 8: Chebyshev points including both ends. The even samples are the Chebyshev points
/// of five samples.
inline double sample_place(std::size_t sample) {
  if (sample == 4) return 0.5;
  return (1 - std::cos(std::numbers::pi * static_cast<double>(sample) / 8)) / 2;
}

/// Absolute values |c_k| of the Chebyshev coefficients of the polynomial through `values` at Chebyshev points in order.
/// The sum of all but the first bounds the distance of the polynomial from the first coefficient.
template <std::size_t points>
std::array<double, points> chebyshev_sizes(const std::array<double, points>& values) {
  using Table = std::array<std::array<double, points>, points>;
  static const Table weights = [] {
    constexpr std::size_t degree = points - 1;
    const auto end = [](std::size_t k) { return k == 0 || k == degree ? 0.5 : 1.0; };
    Table table;
    for (std::size_t k = 0; k < points; ++k) {
      for (std::size_t j = 0; j < points; ++j) {
        const double turn = std::numbers::pi * static_cast<double>(j * k % (2 * degree)) / static_cast<double>(degree);
        table[k][j] = 2 * end(k) * end(j) * std::cos(turn) / static_cast<double>(degree);
      }
    }
    return table;
  }();
  std::array<double, points> sizes;
  for (std::size_t k = 0; k < points; ++k) {
    sizes[k] = std::abs(std::inner_product(values.begin(), values.end(), weights[k].begin(), 0.0));
  }
  return sizes;
}

/// A place off the five samples, to detect aliasing: a sinusoid that turns by less than 125 radians on [0, 1] differs
/// there from what its samples suggest.
inline constexpr double odd_place = 0.315;

/// The value at `odd_place` of the polynomial through five samples, by the barycentric formula.
inline double expected_at_odd_place(const std::array<double, 5>& seen) {
  double sum = 0, weights = 0;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    const double weight = (k % 2 == 0 ? 1 : -1) * (k % 4 == 0 ? 0.5 : 1) / (odd_place - sample_place(2 * k));
    sum += weight * seen[k];
    weights += weight;
  }
  return sum / weights;
}

/// A polynomial of degree 8 on [0, 1] in Bernstein form: its values stay between its smallest and its largest
/// coefficient.
class BernsteinPolynomial {
 public:
  static constexpr std::size_t size = 9;
  using Numbers = std::array<double, size>;

  explicit BernsteinPolynomial(const Numbers& coefficients) : b_(coefficients) {}

  /// The polynomial through `values` at the nine sample places.
  static BernsteinPolynomial through(const Numbers& values) {
    Numbers coefficients{};
    for (std::size_t j = 0; j < size; ++j) {
      for (std::size_t k = 0; k < size; ++k) coefficients[k] += from_samples()[j][k] * values[j];
    }
    return BernsteinPolynomial(coefficients);
  }

  double operator()(double x) const {
    Numbers b = b_;
    for (std::size_t level = size - 1; level > 0; --level) {
      for (std::size_t k = 0; k < level; ++k) b[k] += x * (b[k + 1] - b[k]);
    }
    return b[0];
  }

  double derivative(double x) const {
    Numbers b = b_;
    for (std::size_t level = size - 1; level > 1; --level) {
      for (std::size_t k = 0; k < level; ++k) b[k] += x * (b[k + 1] - b[k]);
    }
    return static_cast<double>(size - 1) * (b[1] - b[0]);
  }

  /// 1 where it is certainly above `band`, −1 where it is certainly below −band, else 0.
  int side(double band) const {
    const auto [least, most] = std::ranges::minmax(b_);
    return least > band ? 1 : most < -band ? -1 : 0;
  }

  /// side(band) of the derivative.
  int slope_side(double band) const {
    Numbers slopes;
    for (std::size_t k = 0; k + 1 < size; ++k) slopes[k] = static_cast<double>(size - 1) * (b_[k + 1] - b_[k]);
    slopes.back() = slopes.front();
    return BernsteinPolynomial(slopes).side(band);
  }

  /// Whether it certainly stays within ±band.
  bool is_within(double band) const {
    return std::ranges::all_of(b_, [&](double value) { return std::abs(value) <= band; });
  }

  /// An enclosure of its values.
  Interval range() const {
    const auto [least, most] = std::ranges::minmax(b_);
    return {least, most};
  }

  /// Its derivative, raised to the same degree.
  BernsteinPolynomial slopes() const {
    constexpr double degree = size - 1;
    Numbers slopes{};
    for (std::size_t k = 0; k + 1 < size; ++k) {
      const double slope = degree * (b_[k + 1] - b_[k]), share = static_cast<double>(k + 1) / degree;
      slopes[k] += (1 - static_cast<double>(k) / degree) * slope;
      slopes[k + 1] += share * slope;
    }
    return BernsteinPolynomial(slopes);
  }

  /// The same polynomial restricted to [low, high], 0 < high, and mapped to [0, 1].
  BernsteinPolynomial part(double low, double high) const {
    Numbers b = b_;
    for (std::size_t level = 1; level < size; ++level) {
      for (std::size_t k = size - 1; k >= level; --k) b[k] = b[k - 1] + high * (b[k] - b[k - 1]);
    }
    const double x = low / high;
    for (std::size_t level = size - 1; level > 0; --level) {
      for (std::size_t k = 0; k < level; ++k) b[k] += x * (b[k + 1] - b[k]);
    }
    return BernsteinPolynomial(b);
  }

  /// The same polynomial restricted to [0, 1/2] and to [1/2, 1], each mapped to [0, 1].
  std::pair<BernsteinPolynomial, BernsteinPolynomial> halves() const {
    Numbers left, right = b_;
    for (std::size_t level = size; level > 0; --level) {
      left[size - level] = right[0];
      for (std::size_t k = 0; k + 1 < level; ++k) right[k] = (right[k] + right[k + 1]) / 2;
    }
    return {BernsteinPolynomial(left), BernsteinPolynomial(right)};
  }

  /// A root between two places where it has different signs, by bisection.
  double zero(double from, double to) const {
    const bool rises = (*this)(to) > 0;
    for (int halvings = 0; halvings < 60; ++halvings) {
      const double middle = (from + to) / 2;
      ((*this)(middle) > 0) == rises ? to = middle : from = middle;
    }
    return (from + to) / 2;
  }

 private:
  // Coefficients of the Lagrange polynomials, which are 1 at one sample place and 0 at the others.
  static const std::array<Numbers, size>& from_samples() {
    static const std::array<Numbers, size> found = [] {
      std::array<Numbers, size> polynomials;
      for (std::size_t j = 0; j < size; ++j) polynomials[j] = one_at(j);
      return polynomials;
    }();
    return found;
  }

  // The product of (x − a)/(x_j − a) over all other places a; each factor raises the degree by one.
  static Numbers one_at(std::size_t j) {
    Numbers b{1};
    double degree = 0;
    for (std::size_t other = 0; other < size; ++other) {
      if (other == j) continue;
      const double a = sample_place(other), scale = 1 / ((sample_place(j) - a) * ++degree);
      for (std::size_t k = static_cast<std::size_t>(degree) + 1; k-- > 0;) {
        const double raised = k == 0 ? 0 : static_cast<double>(k) * (1 - a) * b[k - 1];
        b[k] = scale * (raised - (degree - static_cast<double>(k)) * a * b[k]);
      }
    }
    return b;
  }

  Numbers b_;
};

}  // namespace pendula
