#pragma once

#include <cmath>
#include <type_traits>

namespace pendula {

/// Calls row(name in programs, name in expressions, function) for each operation that both the programs of kernels and
/// expressions have. Functions take numbers of any kind.
template <class Row>
constexpr void shared_operations(Row row) {
  using std::tan, std::asin, std::acos, std::atan, std::sinh, std::cosh, std::tanh, std::exp, std::log, std::sqrt,
      std::pow;
  row("add", "+", [](const auto& x, const auto& y) { return x + y; });
  row("subtract", "-", [](const auto& x, const auto& y) { return x - y; });
  row("multiply", "*", [](const auto& x, const auto& y) { return x * y; });
  row("negative", "~", [](const auto& x) { return -x; });
  row("pow", "^", [](const auto& x, const auto& y) { return pow(x, y); });
  row("tan", "tan", [](const auto& x) { return tan(x); });
  row("asin", "asin", [](const auto& x) { return asin(x); });
  row("acos", "acos", [](const auto& x) { return acos(x); });
  row("atan", "atan", [](const auto& x) { return atan(x); });
  row("sinh", "sinh", [](const auto& x) { return sinh(x); });
  row("cosh", "cosh", [](const auto& x) { return cosh(x); });
  row("tanh", "tanh", [](const auto& x) { return tanh(x); });
  row("exp", "exp", [](const auto& x) { return exp(x); });
  row("log", "log", [](const auto& x) { return log(x); });
  row("sqrt", "sqrt", [](const auto& x) { return sqrt(x); });
}

namespace detail {

/// Number of operands of such a function, one to three.
template <class Function, class Number = double>
inline constexpr int operands_of = std::is_invocable_v<Function, Number>           ? 1
                                   : std::is_invocable_v<Function, Number, Number> ? 2
                                                                                   : 3;

}  // namespace detail

}  // namespace pendula
