#pragma once

#include <span>
#include <string>
#include <string_view>

#include "io/expression_program.hpp"

namespace pendula::io {

/// The name of a function in expressions; empty for an operation that is none.
std::string_view function_name(Operation operation);

bool is_function(std::string_view name);

/// Parses an expression in the columns `names`. Throws ExpressionError.
ExpressionProgram read_expression(const std::string& text, std::span<const std::string> names);

}  // namespace pendula::io
