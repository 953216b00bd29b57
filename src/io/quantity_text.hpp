#pragma once

#include <numbers>
#include <optional>
#include <string>
#include <string_view>

namespace pendula::io {

inline constexpr double degree = std::numbers::pi / 180;
inline constexpr std::string_view degree_sign = "\u00b0";
/// Characters of units that are not ASCII: the degree sign, the micro sign, and the Greek letter that looks like it.
inline constexpr std::string_view unit_signs = "\u00b0\u00b5\u03bc";

/// The units of plain numbers, in SI; not 1 in a scenario in natural units.
struct BaseUnits {
  double mass = 1;    ///< [kg]
  double length = 1;  ///< [m]
  double time = 1;    ///< [s]
};

/// A number and the text after it, as in "90 deg".
struct TextWithUnit {
  double value = 0;
  std::string_view unit;
};

/// Without the blanks around it.
std::string_view trimmed(std::string_view text);

std::optional<TextWithUnit> read_quantity(std::string_view text);

/// The number in a text such as "90 deg", "100 g" or "5 N/cm" as a plain number of a key with this `unit`; nullopt if
/// the text is no such quantity, or one of another kind.
std::optional<double> with_unit(std::string_view text, std::string_view unit, const BaseUnits& base = {});

/// The same for a text that may be a plain number.
std::optional<double> number_or_quantity(std::string_view text, std::string_view unit, const BaseUnits& base = {});

/// The kind of a unit, in a word or two: "a length"; empty if the text is no unit, or the kind has no name.
std::string_view kind_of_unit(std::string_view unit);

/// The same for the unit in a text such as "5 cm".
std::string_view kind_of_quantity(std::string_view text);

/// Strings that a number with this unit may be, for messages: `rad or deg`; empty if it has no unit.
std::string strings_in(std::string_view unit);

}  // namespace pendula::io
