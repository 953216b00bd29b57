// Expressions: any text is one or an ExpressionError, and three ways to evaluate it agree.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "io/expression.hpp"

namespace pendula::io {
namespace {

const std::vector<std::string> names = {"t", "x", "theta_1", "x_dot", "theta_dot_1", "energy"};
constexpr std::array<std::array<double, 6>, 3> rows = {
    {{0, 0, 0, 0, 0, 0}, {1.5, -2, 3.25, 0.125, -7, 40}, {1e9, 1e300, -1e-300, 5e-324, -1, 0.5}}};

bool same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

/// Whether a number lies within bounds, but for rounding.
bool within(double number, const Interval& bounds) {
  const double room = 1e-9 * std::abs(number);
  return number >= bounds.low - room && number <= bounds.high + room;
}

void require(bool good, const char* what, double number) {
  if (good) return;
  std::fprintf(stderr, "%s, at the value %.17g\n", what, number);
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  // A condition that has no value, for an overflow on its way, is true, and max(x, such a number) is x: bounds know
  // nothing of that.
  const bool hides = text.find("max") != std::string::npos || text.find("min") != std::string::npos;
  try {
    Expression expression(text, names);
    for (const auto& row : rows) {
      std::vector<double> numbers;
      std::vector<Reach> reaches;
      std::vector<Dual<double>> duals;
      for (const std::size_t column : expression.columns()) {
        numbers.push_back(row[column]);
        reaches.emplace_back(row[column]);
        duals.emplace_back(row[column]);
      }
      const double value = expression(numbers);
      require(same(expression(duals).value, value), "the value beside a derivative is another", value);
      const Reach reach = expression(reaches);
      if (std::isfinite(value) && !hides && !expression.may_jump()) {
        require(within(value, reach.value), "a value out of its bounds", value);
      }
    }
  } catch (const ExpressionError&) {
    // as it should be
  }
  return 0;
}

}  // namespace pendula::io
