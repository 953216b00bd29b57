#pragma once

#include <span>
#include <string>

#include "io/expression_program.hpp"

namespace pendula::io {

/// Parses an expression in the columns `names`. Throws ExpressionError.
ExpressionProgram read_expression(const std::string& text, std::span<const std::string> names);

}  // namespace pendula::io
