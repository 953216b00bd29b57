#include "cli/usual_start.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/run/assembly.hpp>
#include <vector>

#include "io/errors.hpp"

namespace pendula::cli {
namespace {

constexpr int attempts = 40;

/// A start for an unknown system: different angles and lengths, slow rates. Later attempts are nearer to zero; after
/// `attempts` coordinates are scattered, from which more linkages close.
Motion any_start(const SystemInfo& info, int number) {
  const auto count = static_cast<Eigen::Index>(info.coordinates.size());
  Motion start(0, Eigen::VectorXd(count), Eigen::VectorXd(count));
  const int halvings = number < attempts ? number / 2 : (number - attempts) / 8;
  const double size = std::ldexp(number % 2 == 0 ? 1.0 : -1.0, -halvings);
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto at = static_cast<double>(k);
    const double scattered = std::cos((number + 1) * (at + 1) * (at + 1));
    const double usual = info.is_angle[static_cast<std::size_t>(k)] ? 0.7 : 1.2;
    start.q[k] = size * (number < attempts ? usual + 0.3 * std::sin(at) : 2 * usual * scattered);
    start.v[k] = 0.2 * size * std::cos(2 * at);
  }
  return start;
}

}  // namespace

SystemNumbers usual_numbers(const SystemInfo& info) {
  SystemNumbers numbers;
  for (std::size_t k = 0; k < info.parameters.size(); ++k) {
    const double usual = info.parameter_defaults[k];
    numbers.parameters.insert(numbers.parameters.end(), static_cast<std::size_t>(info.parameter_sizes[k]),
                              std::isfinite(usual) ? usual : 1.0);
  }
  numbers.inputs.assign(info.inputs.size(), 0.0);
  return numbers;
}

Motion usual_start(const SystemSubject& system, const std::string& command) {
  const SystemInfo& info = system.info();
  const std::vector<bool> none(info.coordinates.size(), false);
  const auto all = static_cast<int>(info.constraints.size());
  const int most = all == 0 ? attempts : 2 * attempts;
  constexpr double far = 1e-3;
  for (const bool is_regular : {true, false}) {
    for (int number = 0; number < most; ++number) {
      Motion start = any_start(info, number);
      system.close(start);
      if (!std::isfinite(system.observe(start).energy) || !assemble(system, {none, none}, start).empty()) continue;
      if (!is_regular || independent_constraints(system, start, far) == all) return start;
    }
  }
  const std::string what = all == 0 ? " has an energy" : " has an energy and can be assembled";
  throw io::InputError(command + ": expected a scenario with a start: at none of " + std::to_string(most) +
                       " that were tried the model " + std::string(info.name) + what);
}

}  // namespace pendula::cli
