#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace bench {

/// A planar chain of equal links, all horizontal and at rest: m = 1 kg, g = 9.81 m/s², θ = π/2.
struct Problem {
  std::string_view name;
  int links;
  double length;    ///< of each rod  [m]
  double duration;  ///< s

  static constexpr double mass = 1;
  static constexpr double gravity = 9.81;
  static constexpr double angle = std::numbers::pi / 2;
};

/// D: the usual double pendulum. P(n): a chain one metre long.
inline constexpr std::array problems{
    Problem{"D", 2, 1, 10},
    Problem{"P2", 2, 1. / 2, 5},
    Problem{"P5", 5, 1. / 5, 5},
    Problem{"P10", 10, 1. / 10, 1},
    Problem{"P20", 20, 1. / 20, 1},
    Problem{"P50", 50, 1. / 50, 1},
    Problem{"P100", 100, 1. / 100, 1},
};

/// Calls visit.template operator()<N>() with the number of links as a constant, so that every contestant's equations
/// are compiled for their n.
template <class Visit>
auto with_links(int links, Visit visit) {
  switch (links) {
    case 2:
      return visit.template operator()<2>();
    case 5:
      return visit.template operator()<5>();
    case 10:
      return visit.template operator()<10>();
    case 20:
      return visit.template operator()<20>();
    case 50:
      return visit.template operator()<50>();
    case 100:
      return visit.template operator()<100>();
    default:
      throw std::invalid_argument("no problem has " + std::to_string(links) + " links");
  }
}

/// A step that sums without rounding: `steps - 1` of it and the rest of the duration end where the problem does.
/// duration / steps, rounded, would end elsewhere by more than a floor.
inline double summing_step(const Problem& problem, int steps) {
  return std::ldexp(std::floor(std::ldexp(problem.duration / steps, 40)), -40);
}

/// Where a run ended: absolute angles and their rates.
struct EndState {
  std::vector<double> theta;      ///< rad
  std::vector<double> theta_dot;  ///< rad/s
};

/// The end of a problem, far beyond double precision.
struct Reference {
  std::string_view problem;
  double floor;                         ///< error that half a unit in the last place of the data makes
  std::span<const long double> values;  ///< θ_1..θ_n, then their rates
};

/// max(|Δθ_i|, |Δθ̇_i| / max_j |θ̇_j|) over all links; infinite where anything is not finite, so that no failed run can
/// win by a comparison that is false.
inline double error_of(const EndState& end, const Reference& reference) {
  const std::size_t links = reference.values.size() / 2;
  long double fastest = 0;
  for (std::size_t i = 0; i < links; ++i) fastest = std::max(fastest, std::abs(reference.values[links + i]));
  double error = 0;
  for (std::size_t i = 0; i < links; ++i) {
    const auto angle = static_cast<double>(std::abs(end.theta[i] - reference.values[i]));
    const auto rate = static_cast<double>(std::abs(end.theta_dot[i] - reference.values[links + i]) / fastest);
    if (!std::isfinite(angle) || !std::isfinite(rate)) return std::numeric_limits<double>::infinity();
    error = std::max({error, angle, rate});
  }
  return error;
}

}  // namespace bench
