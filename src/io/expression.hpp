#pragma once

#include <cstddef>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/reach.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/expression_reader.hpp"

namespace pendula::io {

/// A text is not an expression. The caller adds the place of the text.
struct ExpressionError : std::runtime_error {
  ExpressionError(std::string what_was_expected, std::string what_was_got)
      : std::runtime_error(what_was_got), expected(std::move(what_was_expected)), got(std::move(what_was_got)) {}

  std::string expected, got;
};

/// An arithmetic expression in named columns of a row: + − * / ^, comparisons, && ||, ?:, functions as sin, and pi.
class Expression {
 public:
  /// Rates may also have their older names, `theta_1_dot`. Throws ExpressionError.
  Expression(const std::string& text, std::span<const std::string> names);

  /// The columns that it uses, each once.
  const std::vector<std::size_t>& columns() const { return program_.columns; }

  /// Whether it oscillates about as fast as its columns: it is a linear combination of columns and of their sines.
  bool is_plain() const { return program_.is_plain; }

  /// Whether it may jump where its columns change smoothly: by a comparison, ?:, sign, rint or floor.
  bool may_jump() const;

  /// The value for the numbers of `columns`; NaN where there is none.
  double operator()(std::span<const double> numbers);
  /// Bounds of the value over an interval of time, from bounds of the numbers.
  Reach operator()(std::span<const Reach> numbers);
  /// The value, and its derivative along that of the numbers.
  Dual<double> operator()(std::span<const Dual<double>> numbers);

 private:
  template <class Number>
  Number of(std::span<const Number> numbers, std::vector<Number>& values) const;

  ExpressionProgram program_;
  std::vector<double> values_;  // values of the nodes
  std::vector<Reach> reaches_;
  std::vector<Dual<double>> slopes_;
};

}  // namespace pendula::io
