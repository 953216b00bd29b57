#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string>

namespace pendula {

/// Enough characters for any double in any of the formats below.
inline constexpr std::size_t longest_number = 32;

/// Appends `value` with 17 significant digits, which read back as the same double.
inline void append_number(std::string& text, double value) {
  std::array<char, longest_number> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::general, 17);
  text.append(digits.data(), end.ptr);
}

/// `value` rounded to `digits` significant digits, for people to read: -0 is 0.
inline std::string rounded(double value, int digits = 6) {
  std::array<char, longest_number> text;
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value + 0.0, std::chars_format::general, digits);
  return {text.data(), end.ptr};
}

/// `value` with the fewest digits that read back as the same double.
inline std::string shortest(double value) {
  if (std::isnan(value)) return "nan";  // not "-nan"
  std::array<char, longest_number> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

}  // namespace pendula
