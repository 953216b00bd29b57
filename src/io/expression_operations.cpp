#include "io/expression_operations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <pendula/numeric/dual_functions.hpp>
#include <pendula/numeric/shared_operations.hpp>
#include <type_traits>

namespace pendula {

// Functions of dual numbers that expressions have, and kernels do not.
inline Dual<double> abs(const Dual<double>& x) {
  return x.value < 0 ? -x : x;
}
inline Dual<double> atan2(const Dual<double>& y, const Dual<double>& x) {
  const double squared = x.value * x.value + y.value * y.value;
  return {std::atan2(y.value, x.value), (x.value * y.slope - y.value * x.slope) / squared};
}
inline Dual<double> fmod(const Dual<double>& a, const Dual<double>& b) {
  return {std::fmod(a.value, b.value), a.slope - std::trunc(a.value / b.value) * b.slope};
}
inline Dual<double> pow(const Dual<double>& x, const Dual<double>& exponent) {
  const double power = std::pow(x.value, exponent.value);
  double slope = x.slope == 0 ? 0 : exponent.value * std::pow(x.value, exponent.value - 1) * x.slope;
  if (exponent.slope != 0) slope += std::log(x.value) * power * exponent.slope;
  return {power, slope};
}
inline Dual<double> log2(const Dual<double>& x) {
  return {std::log2(x.value), x.slope / (x.value * std::numbers::ln2)};
}
inline Dual<double> log10(const Dual<double>& x) {
  return {std::log10(x.value), x.slope / (x.value * std::numbers::ln10)};
}
inline Dual<double> min(const Dual<double>& a, const Dual<double>& b) {
  return b.value < a.value ? b : a;
}
inline Dual<double> max(const Dual<double>& a, const Dual<double>& b) {
  return a.value < b.value ? b : a;
}
inline Dual<double> choose(const Dual<double>& condition, const Dual<double>& yes, const Dual<double>& no) {
  return condition.value != 0 ? yes : no;
}

}  // namespace pendula

namespace pendula::io {
namespace {

using pendula::detail::operands_of;
using Slope = Dual<double>;

double choose(double condition, double yes, double no) {
  return condition != 0 ? yes : no;
}
Reach greater(const Reach& a, const Reach& b) {
  return less(b, a);
}
Reach at_least(const Reach& a, const Reach& b) {
  return at_most(b, a);
}

template <auto function, class Number>
Number called(const Number& a, [[maybe_unused]] const Number& b, [[maybe_unused]] const Number& c) {
  constexpr int operands = operands_of<decltype(function), Number>;
  if constexpr (operands == 1) {
    return function(a);
  } else if constexpr (operands == 2) {
    return function(a, b);
  } else {
    return function(a, b, c);
  }
}

template <auto function>
Slope without_slope(const Slope& a, const Slope& b, const Slope& c) {
  return Slope(called<function>(a.value, b.value, c.value));
}

template <class Function>
constexpr Operation row(std::string_view name, Operation::Of of, Function, bool jumps = false) {
  constexpr Function f;
  return {name, operands_of<Function>, of, jumps, {&called<f, double>, &called<f, Reach>, &called<f, Slope>}};
}
/// A function that jumps, of numbers and of their bounds. It has no slope.
template <auto of_bounds, class Function>
constexpr Operation jump(std::string_view name, Operation::Of of, Function) {
  constexpr Function f;
  return {name, operands_of<Function>, of, true, {&called<f, double>, &called<of_bounds, Reach>, &without_slope<f>}};
}

// Chooses the overload for bounds.
constexpr Reach (*floor_of_bounds)(const Reach&) = &floor;
constexpr Reach (*rint_of_bounds)(const Reach&) = &rint;

constexpr auto all_operations() {
  using std::sin, std::cos, std::atan2, std::log, std::log2, std::log10, std::fmod, std::abs, std::min, std::max;
  using enum Operation::Of;
  std::array<Operation, 38> all;
  auto* next = all.data();
  const auto add = [&](const Operation& one) { *next++ = one; };
  add(row("sin", models, [](const auto& x) { return sin(x); }));
  add(row("cos", models, [](const auto& x) { return cos(x); }));
  shared_operations([&](std::string_view, std::string_view name, auto call) { add(row(name, models, call)); });
  add(row("/", models, [](const auto& x, const auto& y) { return x / y; }));
  add(row("ln", models, [](const auto& x) { return log(x); }));
  add(row("atan2", rows, [](const auto& y, const auto& x) { return atan2(y, x); }));
  add(row("log2", rows, [](const auto& x) { return log2(x); }));
  add(row("log10", rows, [](const auto& x) { return log10(x); }));
  add(row("abs", drives, [](const auto& x) { return abs(x); }));
  add(jump<sign>("sign", drives, [](double x) { return (x > 0) - (x < 0); }));
  add(jump<rint_of_bounds>("rint", rows, [](double x) { return std::floor(x + 0.5); }));
  add(jump<floor_of_bounds>("floor", rows, [](double x) { return std::floor(x); }));
  add(row("fmod", rows, [](const auto& x, const auto& y) { return fmod(x, y); }));
  add(row("min", drives, [](const auto& x, const auto& y) { return min(x, y); }));
  add(row("max", drives, [](const auto& x, const auto& y) { return max(x, y); }));
  add(jump<less>("<", drives, [](double x, double y) { return x < y; }));
  add(jump<greater>(">", drives, [](double x, double y) { return x > y; }));
  add(jump<at_most>("<=", drives, [](double x, double y) { return x <= y; }));
  add(jump<at_least>(">=", drives, [](double x, double y) { return x >= y; }));
  add(jump<equal>("==", rows, [](double x, double y) { return x == y; }));
  add(jump<unequal>("!=", rows, [](double x, double y) { return x != y; }));
  add(jump<both>("&&", drives, [](double x, double y) { return x != 0 && y != 0; }));
  add(jump<either>("||", drives, [](double x, double y) { return x != 0 || y != 0; }));
  const auto choice = [](const auto& x, const auto& yes, const auto& no) { return choose(x, yes, no); };
  add(row("?:", drives, choice, true));
  return all;
}

constexpr std::array all = all_operations();

}  // namespace

std::span<const Operation> operations() {
  return all;
}

const Operation* operation_named(std::string_view name) {
  const auto* found = std::ranges::find(all, name == "ln" ? "log" : name, &Operation::name);
  return found == all.end() ? nullptr : found;
}

}  // namespace pendula::io
