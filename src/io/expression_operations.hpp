#pragma once

#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/reach.hpp>
#include <span>
#include <string_view>
#include <tuple>

namespace pendula::io {

/// What expressions do with numbers, with their bounds, and with their slopes.
struct Operation {
  /// Which models may have it: all, drives, which are smooth between pieces, or none.
  enum class Of { models, drives, rows };
  template <class Number>
  using Function = Number (*)(const Number& a, const Number& b, const Number& c);

  std::string_view name;  ///< a sign (~: minus of one number) or what a function is called
  int operands = 0;
  Of of = Of::models;
  bool jumps = false;
  std::tuple<Function<double>, Function<Reach>, Function<Dual<double>>> functions;

  template <class Number>
  Number operator()(const Number& a, const Number& b, const Number& c) const {
    return std::get<Function<Number>>(functions)(a, b, c);
  }
  bool is_function() const { return name.front() >= 'a' && name.front() <= 'z'; }
};

std::span<const Operation> operations();

/// The operation of this name, which may be ln; none where there is none.
const Operation* operation_named(std::string_view name);

}  // namespace pendula::io
