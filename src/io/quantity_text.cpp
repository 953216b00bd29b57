#include "io/quantity_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <system_error>

namespace pendula::io {
namespace {

/// Exponents of kg, m, s and rad.
struct Dimension {
  int kg = 0, m = 0, s = 0, rad = 0;

  bool operator==(const Dimension&) const = default;

  void add(const Dimension& other, int power) {
    kg += power * other.kg;
    m += power * other.m;
    s += power * other.s;
    rad += power * other.rad;
  }
};

/// A unit in SI: its dimension and its size.
struct Measure {
  Dimension dimension;
  double size = 1;
};

struct NamedUnit {
  std::string_view name;
  Measure is;
};

constexpr Dimension mass{1, 0, 0, 0}, length{0, 1, 0, 0}, time_span{0, 0, 1, 0}, angle{0, 0, 0, 1};
constexpr Dimension turning{0, 0, -1, 1}, force{1, 1, -2, 0}, energy{1, 2, -2, 0}, work_rate{1, 2, -3, 0};

/// A turn a second is 1 Hz: where an angular frequency is expected, 2 pi rad/s.
constexpr std::array<NamedUnit, 35> named_units = {{
    {"1", {}},
    {"kg", {mass}},
    {"g", {mass, 1e-3}},
    {"mg", {mass, 1e-6}},
    {"t", {mass, 1e3}},
    {"m", {length}},
    {"km", {length, 1e3}},
    {"cm", {length, 1e-2}},
    {"mm", {length, 1e-3}},
    {"um", {length, 1e-6}},
    {"\u00b5m", {length, 1e-6}},
    {"\u03bcm", {length, 1e-6}},
    {"s", {time_span}},
    {"ms", {time_span, 1e-3}},
    {"us", {time_span, 1e-6}},
    {"\u00b5s", {time_span, 1e-6}},
    {"\u03bcs", {time_span, 1e-6}},
    {"min", {time_span, 60}},
    {"h", {time_span, 3600}},
    {"rad", {angle}},
    {"mrad", {angle, 1e-3}},
    {"deg", {angle, degree}},
    {"turn", {angle, 360 * degree}},
    {"rpm", {turning, 6 * degree}},
    {"Hz", {turning, 360 * degree}},
    {"kHz", {turning, 360e3 * degree}},
    {"N", {force}},
    {"mN", {force, 1e-3}},
    {"kN", {force, 1e3}},
    {"J", {energy}},
    {"mJ", {energy, 1e-3}},
    {"kJ", {energy, 1e3}},
    {"W", {work_rate}},
    {"mW", {work_rate, 1e-3}},
    {"kW", {work_rate, 1e3}},
}};

struct NamedKind {
  std::string_view name;
  Dimension dimension;
};

constexpr std::array<NamedKind, 14> kinds = {{
    {"a mass", mass},
    {"a length", length},
    {"a time", time_span},
    {"an angle", angle},
    {"an angular velocity", turning},
    {"a velocity", {0, 1, -1, 0}},
    {"an acceleration", {0, 1, -2, 0}},
    {"a force", force},
    {"a torque or energy", energy},
    {"a power", work_rate},
    {"a stiffness", {1, 0, -2, 0}},
    {"a damping", {1, 0, -1, 0}},
    {"a moment of inertia", {1, 2, 0, 0}},
    {"an angular momentum", {1, 2, -1, 0}},
}};

/// One unit with its power, as `s^2`; nothing if it is not known.
std::optional<Measure> read_factor(std::string_view text, int sign) {
  const std::size_t caret = std::min(text.find('^'), text.size());
  int power = 1;
  if (caret < text.size()) {
    const char* const end = text.data() + text.size();
    const auto [at, error] = std::from_chars(text.data() + caret + 1, end, power);
    if (error != std::errc() || at != end || std::abs(power) > 9) return std::nullopt;
  }
  const auto unit = std::ranges::find(named_units, text.substr(0, caret), &NamedUnit::name);
  if (unit == named_units.end()) return std::nullopt;
  Measure found{{}, std::pow(unit->is.size, sign * power)};
  found.dimension.add(unit->is.dimension, sign * power);
  return found;
}

/// Reads products and quotients, as UDUNITS has them: `kg m^2`, `N m s/rad`. nullopt if a unit is not known.
std::optional<Measure> read_unit(std::string_view text) {
  Measure all;
  int sign = 1;
  for (text = trimmed(text); !text.empty();) {
    const std::size_t end = std::min(text.find_first_of(" */"), text.size());
    const std::optional<Measure> factor = read_factor(text.substr(0, end), sign);
    if (!factor) return std::nullopt;
    all.dimension.add(factor->dimension, 1);
    all.size *= factor->size;
    text = trimmed(text.substr(end));
    const bool has_sign = text.starts_with('/') || text.starts_with('*');
    sign = text.starts_with('/') ? -1 : 1;
    if (!has_sign) continue;
    text = trimmed(text.substr(1));
    if (text.empty()) return std::nullopt;
  }
  return all;
}

/// Whether two dimensions are of one kind. Those with mass, such as torques, may be written per rad or not.
bool is_same_kind(Dimension a, Dimension b) {
  if (a.kg != 0) a.rad = b.rad = 0;
  return a == b;
}

/// The unit with "deg" for the degree sign.
std::string plain_name(std::string_view unit) {
  std::string name(unit);
  if (name.starts_with(degree_sign)) name.replace(0, degree_sign.size(), "deg");
  return name;
}

}  // namespace

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

std::optional<double> with_unit(std::string_view text, std::string_view unit, const BaseUnits& base) {
  const std::optional<TextWithUnit> quantity = read_quantity(text);
  if (!quantity || quantity->unit.empty() || unit.empty()) return std::nullopt;
  const std::optional<Measure> given = read_unit(plain_name(quantity->unit)), wanted = read_unit(unit);
  if (!given || !wanted) return quantity->unit == unit ? std::optional(quantity->value) : std::nullopt;
  if (!is_same_kind(given->dimension, wanted->dimension)) return std::nullopt;
  const Dimension& of = wanted->dimension;
  const double plain =
      wanted->size * std::pow(base.mass, of.kg) * std::pow(base.length, of.m) * std::pow(base.time, of.s);
  return quantity->value * (given->size / plain);
}

std::optional<double> number_or_quantity(std::string_view text, std::string_view unit, const BaseUnits& base) {
  const std::optional<TextWithUnit> quantity = read_quantity(text);
  return quantity && quantity->unit.empty() ? std::optional(quantity->value) : with_unit(text, unit, base);
}

std::string_view kind_of_unit(std::string_view unit) {
  const std::optional<Measure> measure = unit.empty() ? std::nullopt : read_unit(unit);
  if (!measure) return "";
  const auto same = [&](const NamedKind& kind) { return is_same_kind(kind.dimension, measure->dimension); };
  const auto kind = std::ranges::find_if(kinds, same);
  return kind == kinds.end() ? "" : kind->name;
}

std::string_view kind_of_quantity(std::string_view text) {
  const std::optional<TextWithUnit> quantity = read_quantity(text);
  return quantity ? kind_of_unit(plain_name(quantity->unit)) : "";
}

std::string strings_in(std::string_view unit) {
  if (unit == "rad") return "rad or deg";
  if (unit == "rad/s") return "rad/s or deg/s";
  return std::string(unit);
}

}  // namespace pendula::io
