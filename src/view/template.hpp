#pragma once

#include <string>
#include <string_view>

namespace pendula::view {

/// A text in which {{name}} is replaced by part(name).
template <class Part>
std::string filled(std::string_view text, const Part& part) {
  std::string filled;
  for (std::size_t begin = text.find("{{"); begin != std::string_view::npos; begin = text.find("{{")) {
    const std::size_t end = text.find("}}", begin);
    filled += text.substr(0, begin);
    filled += part(std::string(text.substr(begin + 2, end - begin - 2)));
    text.remove_prefix(end + 2);
  }
  return filled += text;
}

}  // namespace pendula::view
