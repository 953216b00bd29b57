#pragma once

#include <numbers>
#include <optional>
#include <span>
#include <string_view>

namespace pendula::io {

inline constexpr double degree = std::numbers::pi / 180;
inline constexpr std::string_view degree_sign = "\u00b0";

/// A unit in a string such as "90 deg".
struct Unit {
  std::string_view name;
  double size;  ///< relative to the unit of plain numbers
};
using Units = std::span<const Unit>;

/// A number and the text after it, as in "90 deg".
struct TextWithUnit {
  double value = 0;
  std::string_view unit;
};

/// Without the blanks around it.
std::string_view trimmed(std::string_view text);

std::optional<TextWithUnit> read_quantity(std::string_view text);

/// The number in a text such as "90 deg" or "90°".
std::optional<double> with_unit(std::string_view text, Units units);

}  // namespace pendula::io
