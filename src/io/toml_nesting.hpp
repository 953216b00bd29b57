#pragma once

#include <string_view>

namespace pendula::io {

/// Deepest that keys and values may be nested in a scenario, which needs no more than four of either.
inline constexpr int max_nesting = 16;

/// First line of TOML text, from 1, in which a key has more than `max_nesting` parts, or a value is nested deeper than
/// that; 0 for none. A parser that recurses would run out of stack on such text, so it is asked before one sees it.
int line_nested_too_deep(std::string_view text);

}  // namespace pendula::io
