#include "io/shown.hpp"

#include <cstddef>
#include <pendula/numeric/number_text.hpp>

namespace pendula::io {
namespace {

constexpr std::size_t longest_shown = 60;

/// Floats keep their point, so that `expected an integer, got 3.0` makes sense.
std::string shown_float(double value) {
  const std::string text = shortest(value);
  return text.find_first_not_of("-0123456789") == std::string::npos ? text + ".0" : text;
}

std::string shown_array(const toml::array& array) {
  std::string text = "[";
  for (const toml::node& element : array) {
    if (text.size() > 1) text += ", ";
    if (text.size() > longest_shown) return text + "...] (" + std::to_string(array.size()) + " values)";
    text += shown(element);
  }
  return text + "]";
}

}  // namespace

std::string line_place(const std::string& name, std::int64_t line) {
  return name.starts_with(override_prefix) ? name : name + ":" + std::to_string(line);
}

std::string location(const toml::source_region& source) {
  return line_place(source.path ? *source.path : std::string("scenario"), source.begin.line);
}

std::string cut(std::string_view text) {
  if (text.size() <= longest_shown) return std::string(text);
  std::size_t end = longest_shown;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return std::string(text.substr(0, end)) + "...";
}

std::string printable(std::string_view text) {
  std::string shown = cut(text);
  for (char& c : shown) {
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';  // no control characters
  }
  return shown;
}

std::string toml_string(std::string_view text) {
  return '"' + printable(text) + '"';
}

std::string shown(const toml::node& node) {
  if (const auto* array = node.as_array()) return shown_array(*array);
  if (node.is_table()) return "a table";
  if (const auto* value = node.as_string()) return toml_string(value->get());
  if (const auto* value = node.as_floating_point()) return shown_float(value->get());
  if (const auto* value = node.as_integer()) return std::to_string(value->get());
  if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
  return "a date or time";
}

}  // namespace pendula::io
