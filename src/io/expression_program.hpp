#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pendula::io {

enum class Operation : std::uint8_t {
  constant,
  column,
  negative,
  sum,
  difference,
  product,
  ratio,
  power,
  less,
  greater,
  at_most,
  at_least,
  equal,
  unequal,
  both,
  either,
  choose,
  sine,
  cosine,
  tangent,
  arcsine,
  arccosine,
  arctangent,
  arctangent2,
  hyperbolic_sine,
  hyperbolic_cosine,
  hyperbolic_tangent,
  exponential,
  logarithm,
  logarithm2,
  logarithm10,
  root,
  size,
  sign,
  rint,
  floor,
  remainder,
  least,
  largest
};

/// A parsed expression: operations in the order in which they are computed, each after its operands.
struct ExpressionProgram {
  struct Node {
    Operation operation = Operation::constant;
    std::size_t a = 0, b = 0, c = 0;  // places of the operands; a column has its place in `columns` in `a`
    double number = 0;                // value of a constant
  };

  std::vector<Node> nodes;
  std::vector<std::size_t> columns;  // columns of the row that it uses, each once
  bool is_plain = false;             // see Expression::is_plain
};

}  // namespace pendula::io
