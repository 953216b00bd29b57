#pragma once

#include <numbers>
#include <optional>
#include <string>
#include <string_view>

namespace pendula::io {

inline constexpr double degree = std::numbers::pi / 180;
inline constexpr std::string_view degree_sign = "\u00b0";
/// Characters of units that are not ASCII: that one, the micro sign, and the Greek letter that looks like it.
inline constexpr std::string_view unit_signs = "\u00b0\u00b5\u03bc";

/// Units of mass, length and time in which plain numbers are; those of a natural scenario are not 1.
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

/// The number in a text such as "90 deg", "100 g" or "5 N/cm" as a plain number of a key with this `unit`; nothing if
/// it is none, or one of another kind.
std::optional<double> with_unit(std::string_view text, std::string_view unit, const BaseUnits& base = {});

/// The same of a text that may be a plain number.
std::optional<double> number_or_quantity(std::string_view text, std::string_view unit, const BaseUnits& base = {});

/// What a unit measures, in a word or two: "a length"; empty if it is no unit, or none that has a name.
std::string_view kind_of_unit(std::string_view unit);

/// The same of the unit in a text such as "5 cm".
std::string_view kind_of_quantity(std::string_view text);

/// Strings that a number with this unit may be, for messages: `rad or deg`; empty if it has no unit.
std::string strings_in(std::string_view unit);

}  // namespace pendula::io
