#include <cmath>
#include <contestant.hpp>
#include <limits>

namespace bench {

std::vector<double> tolerances(int first, int last, int each) {
  std::vector<double> values;
  for (int k = first * each; k <= last * each; ++k) values.push_back(std::pow(10., -static_cast<double>(k) / each));
  return values;
}

std::vector<double> step_counts(const Problem& problem, double coarsest, double factor, int count) {
  std::vector<double> values;
  double steps = coarsest * problem.duration * (10 + 2 * problem.links);
  for (int k = 0; k < count; ++k, steps *= factor) {
    if (values.empty() || std::ceil(steps) > values.back()) values.push_back(std::ceil(steps));
  }
  return values;
}

EndState failed(const Problem& problem) {
  const std::vector<double> nothing(static_cast<std::size_t>(problem.links), std::numeric_limits<double>::quiet_NaN());
  return {nothing, nothing};
}

}  // namespace bench
