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

/// A planar chain of equal links, all horizontal and at rest: m = 1 kg, g = 9.81 m/s², θ = π/2. Or, where a kernel is
/// named, that system, as systems.hpp starts it.
struct Problem {
  std::string_view name;
  int links;                     ///< of a system that is no chain, coordinates
  double length;                 ///< of each rod  [m]
  double duration;               ///< s
  std::string_view kernel = {};  ///< of a system that is no chain

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

/// What generated kernels race on: few links, and other systems.
inline constexpr std::array kernel_problems{
    problems[0],
    problems[1],
    Problem{"P4", 4, 1. / 4, 5},
    Problem{"cart chain", 3, 0, 10, "cart_chain_2"},
    Problem{"spring pendulum", 3, 0, 10, "spring_pendulum"},
    Problem{"furuta", 2, 0, 10, "furuta"},
    Problem{"swinging atwood", 2, 0, 10, "swinging_atwood"},
};

/// Calls visit.template operator()<N>() with the number of links as a constant, so that every contestant's equations
/// are compiled for their n.
template <class Visit>
auto with_links(int links, Visit visit) {
  switch (links) {
    case 2:
      return visit.template operator()<2>();
    case 4:
      return visit.template operator()<4>();
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

/// Where a run ended: absolute angles, or whatever the coordinates are, and their rates.
struct EndState {
  std::vector<double> theta;      ///< rad, m
  std::vector<double> theta_dot;  ///< rad/s, m/s
};

/// The end of a problem, far beyond double precision.
struct Reference {
  std::string_view problem;
  double floor;                         ///< error that half a unit in the last place of the data makes
  std::span<const long double> values;  ///< θ_1..θ_n, then their rates
  std::string_view units = {};          ///< of each coordinate, r (rad) or m; none where all are angles
};

/// The end of a problem, out of a table of them.
inline const Reference& reference_of(const Problem& problem, std::span<const Reference> table) {
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const Reference& each) { return each.problem == problem.name; });
  if (found == table.end()) throw std::invalid_argument("no reference of " + std::string(problem.name));
  return *found;
}

/// What a difference of each value counts relative to: of an angle one radian, of a length the longest of them, of a
/// rate the fastest of its unit.
inline std::vector<long double> sizes_of(std::span<const long double> values, std::string_view units) {
  const std::size_t count = values.size() / 2;
  const auto unit = [&](std::size_t i) { return units.empty() ? 'r' : units[i % count]; };
  std::vector<long double> sizes(values.size(), 1);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i < count && unit(i) == 'r') continue;
    const std::size_t first = i < count ? 0 : count;
    sizes[i] = 0;
    for (std::size_t k = first; k < first + count; ++k) {
      if (unit(k) == unit(i)) sizes[i] = std::max(sizes[i], std::abs(values[k]));
    }
  }
  return sizes;
}

/// max(|Δθ_i|, |Δθ̇_i| / max_j |θ̇_j|) over all links, other coordinates as sizes_of tells; infinite where anything is
/// not finite, so that no failed run can win by a comparison that is false.
inline double error_of(const EndState& end, const Reference& reference) {
  const std::vector<long double> sizes = sizes_of(reference.values, reference.units);
  const std::size_t links = sizes.size() / 2;
  double error = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const double value = i < links ? end.theta[i] : end.theta_dot[i - links];
    const auto off = static_cast<double>(std::abs(value - reference.values[i]) / sizes[i]);
    if (!std::isfinite(off)) return std::numeric_limits<double>::infinity();
    error = std::max(error, off);
  }
  return error;
}

}  // namespace bench
