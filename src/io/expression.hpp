#pragma once

#include <cstddef>
#include <cstdint>
#include <pendula/numeric/reach.hpp>
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

/// An arithmetic expression in named columns of a row: + − * / ^, comparisons, && ||, ?:, functions as sin, and pi.
class Expression {
 public:
  /// Rates may have their names of old, `theta_1_dot`. Throws ExpressionError.
  Expression(const std::string& text, std::span<const std::string> names);

  /// Columns that it uses, each once.
  const std::vector<std::size_t>& columns() const { return columns_; }

  /// Whether it turns about as fast as its columns do: a sum of them, and of sines of them, with factors.
  bool is_plain() const { return is_plain_; }

  /// Its value for the numbers of `columns`; NaN where it has none.
  double operator()(std::span<const double> numbers);
  /// What it is over a time, of what they are.
  Reach operator()(std::span<const Reach> numbers);

 private:
  friend class ExpressionReader;

  /// In order: the places of operands are before it.
  struct Node {
    std::uint8_t operation = 0;
    std::size_t a = 0, b = 0, c = 0;  // operands; the first of a column is its place in `columns`
    double number = 0;                // of a constant
  };

  template <class Number>
  Number of(std::span<const Number> numbers, std::vector<Number>& values) const;

  std::vector<Node> nodes_;
  std::vector<std::size_t> columns_;
  bool is_plain_ = false;
  std::vector<double> values_;  // of nodes, while it is computed
  std::vector<Reach> reaches_;
};

}  // namespace pendula::io
