#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace pendula::io {

/// A text is no expression: whoever knows its place adds that.
struct ExpressionError : std::runtime_error {
  ExpressionError(std::string what_was_expected, std::string what_was_got)
      : std::runtime_error(what_was_got), expected(std::move(what_was_expected)), got(std::move(what_was_got)) {}

  std::string expected, got;
};

/// An arithmetic expression in named columns of a row, by muParser: + − * / ^, comparisons, ?:, functions as sin, and
/// pi.
class Expression {
 public:
  /// Rates may have their names of old, `theta_1_dot`. Throws ExpressionError.
  Expression(const std::string& text, std::span<const std::string> names);
  ~Expression();
  Expression(const Expression&) = delete;
  Expression& operator=(const Expression&) = delete;

  /// Columns that it uses.
  const std::vector<std::size_t>& columns() const { return columns_; }

  /// Its value for a row; NaN where it has none.
  double operator()(std::span<const double> row);

 private:
  struct Parser;
  std::unique_ptr<Parser> parser_;
  std::vector<std::size_t> columns_;
  std::vector<double> values_;  // of the columns, where the parser looks for them
};

}  // namespace pendula::io
