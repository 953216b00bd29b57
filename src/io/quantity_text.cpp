#include "io/quantity_text.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <string>
#include <system_error>

namespace pendula::io {

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  return first == std::string_view::npos ? "" : text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::optional<TextWithUnit> read_quantity(std::string_view text) {
  text = trimmed(text);
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  TextWithUnit quantity;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), quantity.value);
  if (error != std::errc()) return std::nullopt;
  quantity.unit = trimmed(text.substr(static_cast<std::size_t>(end - text.data())));
  return quantity;
}

std::optional<double> with_unit(std::string_view text, Units units) {
  const std::optional<TextWithUnit> quantity = read_quantity(text);
  if (!quantity) return std::nullopt;
  std::string name(quantity->unit);
  if (name.starts_with(degree_sign)) name.replace(0, degree_sign.size(), "deg");
  const auto unit = std::ranges::find(units, name, &Unit::name);
  return unit == units.end() ? std::nullopt : std::optional(quantity->value * unit->size);
}

}  // namespace pendula::io
