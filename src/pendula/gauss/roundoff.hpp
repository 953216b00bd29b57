#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace pendula {

/// How the corrections of an iteration shrink.
enum class Convergence {
  linear,    ///< δ_{k+1} ≈ ρ δ_k: fixed point
  quadratic  ///< δ_{k+1} ≈ C δ_k²: Newton
};

/// The relative size at which corrections for so many links usually stop shrinking: 1e-12 in double, more for many
/// links. The velocity of a link is a second difference of momenta along the chain, so rounding grows like the square
/// of the number of links. (Measured in space: 8e-10, 9e-8 and 1e-5 for 10³, 10⁴ and 10⁵ links.)
inline double usual_rounding(int links, double epsilon) {
  return std::max(4500.0, 45.0 * links * links) * epsilon;
}

/// How much coarser numbers are than doubles.
constexpr double coarseness(double epsilon) {
  return epsilon / std::numeric_limits<double>::epsilon();
}

/// No iteration that converges stops shrinking above this.
inline double most_rounding(int links, double epsilon) {
  return std::max(1e-7 * std::sqrt(coarseness(epsilon)), usual_rounding(links, epsilon));
}

}  // namespace pendula
