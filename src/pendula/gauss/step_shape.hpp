#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/tableau.hpp>

namespace pendula {

/// How fast the motion goes on.
struct Tempo {
  double pace = 0;        ///< R: 1/R is the time in which the motion changes  [1/s]
  double quickening = 0;  ///< d ln R/dt; of the motion backwards its opposite  [1/s]
};

/// What a step that was solved shows of its own error.
struct StepShape {
  /// Sizes of the Legendre coefficients of the rates on the step, times h, relative to the size of the motion  [rad].
  std::array<double, max_stages> decay{};
  /// The coefficient of degree s, the first that s stages cannot show: by how much their polynomial misses the rates
  /// where the step starts. 0 where nobody looks.
  double beyond = 0;
  double pace = 0;       ///< R in the middle  [1/s]
  double imbalance = 0;  ///< of energy, relative to what there is; 0 where nobody looks

  /// A coefficient that is smaller, relative to its coordinate, may be what that is rounded by.
  static constexpr double visible = 8 * std::numeric_limits<double>::epsilon();

  /// The error of a step h by a method of this order and so many stages, relative to the size of the motion.
  /// Coefficients of analytic motion decay geometrically, and the quadrature misses those from a degree of `order` on:
  /// the last ones go on as they have come from h R, or, of swings that are small beside a radian, from what the
  /// coefficients begin with, also where the swing turns; or, where that is worse, as from those before them.
  double error(double h, int stages, int order) const {
    const double moved = std::abs(h) * pace;
    if (stages == 1) return moved * moved * moved;
    const double size = std::min(moved, small * std::max(at(0), at(1) / std::min(moved, 1.0)));
    double error = 0;
    for (int k = std::max(1, stages - 2); k < stages; ++k) {
      if (at(k) > rounding * moved) error = std::max(error, extended(at(k), k, size, order));
    }
    if (beyond > rounding * moved) error = std::max(error, extended(beyond, stages, size, order));
    if (stages < 4 || error == 0) return error;
    const double last = std::hypot(at(stages - 1), at(stages - 2)), before = std::hypot(at(stages - 3), at(stages - 4));
    const double ratio = std::sqrt(std::min(1.0, last / before));  // from degree to degree
    return std::max(error, std::max(at(stages - 1), ratio * at(stages - 2)) * std::pow(ratio, order - stages + 1));
  }

  /// With so few stages all rests on one coefficient, which vanishes where loads balance gravity: that of degree s is
  /// worth its time where there are any.
  static constexpr int few_stages = 2;

 private:
  static constexpr double small = 10;  // h R over the largest coefficient
  // Coefficients that are smaller, relative to h R, may be rounding; what follows from them would not show.
  static constexpr double rounding = 1e-13;

  // The coefficient that quadrature begins to miss, where they decay from `size` to that of degree k as they go on to
  // do.
  static double extended(double coefficient, int k, double size, int order) {
    return coefficient * std::pow(coefficient / size, (order - k) / double(k));
  }

  double at(int k) const { return decay[static_cast<std::size_t>(k)]; }
};

}  // namespace pendula
