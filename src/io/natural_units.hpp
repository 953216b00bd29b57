#pragma once

#include <cmath>
#include <optional>
#include <pendula/chain/chain.hpp>
#include <string>
#include <string_view>

namespace pendula::io {

/// The units of a nondimensional scenario (paper §3.1) in SI: lengths in l_1, masses in the total mass M_1, times in
/// sqrt(l_1/g). Two links then depend on m = m_2/(m_1+m_2) and l = l_2/l_1 alone.
struct NaturalUnits {
  double length = 1;  ///< l_1  [m]
  double mass = 1;    ///< M_1  [kg]
  double time = 1;    ///< sqrt(l_1/g)  [s]

  double energy() const { return mass * length * length / (time * time); }  ///< M_1 g l_1  [J]; of torques too
  double damping() const { return energy() * time; }                        ///< [N m s]
};

/// The natural units of a chain given in SI. `parameters.gravity` must be positive.
template <class Space>
NaturalUnits natural_units(const ChainParameters<Space>& parameters) {
  const double length = parameters.lengths[0];
  return {length, parameters.masses.sum(), std::sqrt(length / parameters.gravity)};
}

/// Masses, lengths, gravity, damping and constant torque in `units`. Drives are not changed: a scenario gives them in
/// its own units.
template <class Space>
ChainParameters<Space> in_units(const NaturalUnits& units, ChainParameters<Space> parameters) {
  parameters.masses /= units.mass;
  parameters.lengths /= units.length;
  parameters.gravity = 1;
  parameters.damping /= units.damping();
  parameters.torque /= units.energy();
  return parameters;
}

/// Names of the natural units, as in summaries.
struct UnitNames {
  std::string_view length, mass, time, energy;
};

inline UnitNames unit_names(const std::optional<NaturalUnits>& natural) {
  return natural ? UnitNames{" l_1", " M_1", " sqrt(l_1/g)", " M_1 g l_1"} : UnitNames{" m", " kg", " s", " J"};
}

/// The scenario's own unit for an SI unit.
inline std::string in_units(const std::optional<NaturalUnits>& natural, const std::string& unit) {
  if (!natural) return unit;
  const UnitNames names = unit_names(natural);
  const auto alone = [](std::string_view name) { return std::string(name.substr(1)); };
  if (unit == "m") return alone(names.length);
  if (unit == "s") return alone(names.time);
  if (unit == "kg") return alone(names.mass);
  if (unit == "J" || unit == "N m") return alone(names.energy);
  if (unit == "N m s/rad") return alone(names.energy) + " " + alone(names.time) + " / rad";
  if (unit == "N") return alone(names.mass) + " g";
  if (unit == "1/s") return "1 / " + alone(names.time);
  if (unit == "m/s^2") return "g";
  if (unit == "rad/s") return "rad / " + alone(names.time);
  return unit;
}

}  // namespace pendula::io
