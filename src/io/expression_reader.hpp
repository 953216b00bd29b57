#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace pendula::io {

struct Operation;

/// A parsed expression: numbers, columns and operations in the order in which they are computed, each after its
/// operands.
struct ExpressionProgram {
  struct Node {
    const Operation* operation = nullptr;  // none of a number, or of a column
    std::size_t a = 0, b = 0, c = 0;       // places of the operands; a column has its place in `columns` in `a`
    bool is_column = false;
    double number = 0;
  };

  std::vector<Node> nodes;
  std::vector<std::size_t> columns;  // columns of the row that it uses, each once
  bool is_plain = false;             // see Expression::is_plain
};

/// Parses an expression in the columns `names`. Throws ExpressionError.
ExpressionProgram read_expression(const std::string& text, std::span<const std::string> names);

}  // namespace pendula::io
