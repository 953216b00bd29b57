#include "io/expression.hpp"

#include <algorithm>

#include "io/expression_operations.hpp"

namespace pendula::io {

Expression::Expression(const std::string& text, std::span<const std::string> names)
    : program_(read_expression(text, names)) {}

template <class Number>
Number Expression::of(std::span<const Number> numbers, std::vector<Number>& values) const {
  values.resize(program_.nodes.size());
  Number *const all = values.data(), *next = all;
  for (const ExpressionProgram::Node& node : program_.nodes) {
    *next++ = node.operation   ? (*node.operation)(all[node.a], all[node.b], all[node.c])
              : node.is_column ? numbers[node.a]
                               : Number(node.number);
  }
  return values.back();
}

bool Expression::may_jump() const {
  return std::ranges::any_of(program_.nodes, [](const auto& node) { return node.operation && node.operation->jumps; });
}

double Expression::operator()(std::span<const double> numbers) {
  return of(numbers, values_);
}

Reach Expression::operator()(std::span<const Reach> numbers) {
  return of(numbers, reaches_);
}

Dual<double> Expression::operator()(std::span<const Dual<double>> numbers) {
  return of(numbers, slopes_);
}

}  // namespace pendula::io
