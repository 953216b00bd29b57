#pragma once

#include <string_view>

namespace pendula::io {

/// Greatest depth of nested keys and values; a scenario needs four.
inline constexpr int max_nesting = 16;

/// The first line, from 1, of TOML text in which a key has more than `max_nesting` parts, or a value is nested deeper;
/// 0 if there is none. To be asked before parsing: a recursive parser would exhaust the stack on such text.
int line_nested_too_deep(std::string_view text);

}  // namespace pendula::io
