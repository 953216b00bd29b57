#include "io/toml_nesting.hpp"

#include <algorithm>
#include <cstddef>

namespace pendula::io {
namespace {

/// One past the last quote of the string that begins at `begin`; the end of the text if it does not end.
std::size_t string_end(std::string_view text, std::size_t begin) {
  const char quote = text[begin];
  const std::string_view three = text.substr(begin, 3);
  const bool multi_line = three.size() == 3 && three[1] == quote && three[2] == quote;
  for (std::size_t i = begin + (multi_line ? 3 : 1); i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;  // an escaped character does not end the string
    } else if (multi_line && text.substr(i, 3) == three) {
      return i + 3;
    } else if (!multi_line && (text[i] == quote || text[i] == '\n')) {
      return i + (text[i] == quote ? 1 : 0);
    }
  }
  return text.size();
}

}  // namespace

int line_nested_too_deep(std::string_view text) {
  int depth = 0, dots = 0, line = 1;
  for (std::size_t i = 0; i < text.size(); ++i) {
    switch (text[i]) {
      case '#':
        i = std::min(text.find('\n', i), text.size()) - 1;
        break;
      case '"':
      case '\'': {
        const std::size_t end = string_end(text, i);
        line += static_cast<int>(std::ranges::count(text.substr(i, end - i), '\n'));
        i = end - 1;
        break;
      }
      case '[':
      case '{':
        ++depth;
        dots = 0;
        break;
      case ']':
      case '}':
        depth = std::max(depth - 1, 0);
        break;
      case '.':
        ++dots;
        break;
      case '\n':
        ++line;
        [[fallthrough]];
      case '=':
      case ',':
        dots = 0;
        break;
      default:
        break;
    }
    if (depth > max_nesting || dots >= max_nesting) return line;
  }
  return 0;
}

}  // namespace pendula::io
