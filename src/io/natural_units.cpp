#include "io/natural_units.hpp"

namespace pendula::io {

std::string in_units(const std::optional<NaturalUnits>& natural, const std::string& unit) {
  if (!natural) return unit;
  const UnitNames names = unit_names(natural);
  const auto alone = [](std::string_view name) { return std::string(name.substr(1)); };
  if (unit == "m") return alone(names.length);
  if (unit == "s") return alone(names.time);
  if (unit == "kg") return alone(names.mass);
  if (unit == "J" || unit == "N m") return alone(names.energy);
  if (unit == "N m s/rad") return alone(names.energy) + " " + alone(names.time) + " / rad";
  if (unit == "1/s") return "1 / " + alone(names.time);
  if (unit == "m/s^2") return "g";
  if (unit == "rad/s") return "rad / " + alone(names.time);
  return unit;
}

}  // namespace pendula::io
