#include "io/expression.hpp"

#include <algorithm>
#include <array>

#include "io/expression_operations.hpp"
#include "io/expression_reader.hpp"

namespace pendula::io {

Expression::Expression(const std::string& text, std::span<const std::string> names)
    : program_(read_expression(text, names)) {}

template <class Number>
Number Expression::of(std::span<const Number> numbers, std::vector<Number>& values) const {
  values.resize(program_.nodes.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    const ExpressionProgram::Node& node = program_.nodes[k];
    values[k] = node.operation == Operation::constant ? Number(node.number)
                : node.operation == Operation::column
                    ? numbers[node.a]
                    : detail::applied(node.operation, values[node.a], values[node.b], values[node.c]);
  }
  return values.back();
}

bool Expression::may_jump() const {
  using enum Operation;
  constexpr std::array jumping = {less, greater, at_most, at_least, equal, unequal,
                                  both, either,  choose,  sign,     rint,  floor};
  return std::ranges::any_of(program_.nodes, [&](const ExpressionProgram::Node& node) {
    return std::ranges::find(jumping, node.operation) != jumping.end();
  });
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
