#pragma once

#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/reach.hpp>
#include <span>
#include <string_view>
#include <tuple>

namespace pendula::io {

/// An operation of expressions, on numbers, on bounds of numbers, and on numbers with slopes.
struct Operation {
  /// Where it may stand. models: anywhere, also in feedback of models; drives: in drives, which may have pieces, and in
  /// expressions of rows; rows: only in these.
  enum class Of { models, drives, rows };
  template <class Number>
  using Function = Number (*)(const Number& a, const Number& b, const Number& c);

  std::string_view name;  ///< a sign (~: minus of one number) or the name of a function
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

/// The operation of this name, or of ln; null if there is none.
const Operation* operation_named(std::string_view name);

}  // namespace pendula::io
