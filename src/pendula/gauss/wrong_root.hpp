#pragma once

/// Bounds beyond which a solution of the stage equations may not be the motion (Status::wrong_root).
namespace pendula::detail {

/// The largest turn in one step of rods, and of systems with a constant mass matrix  [rad].
inline constexpr double largest_turn = 3;
/// The same where inertia may vanish: there a coordinate may move much faster than the others.
inline constexpr double largest_turn_by_inertia = 0.25;

constexpr double largest_turn_of(bool constant_masses) {
  return constant_masses ? largest_turn : largest_turn_by_inertia;
}

/// Where the first correction is larger than this, relative to the unknowns, or a link turns farther  [rad], the energy
/// of the solution is checked.
inline constexpr double trusted_prediction = 0.02, trusted_turn = 0.5;
/// The largest energy error of such a step, relative to the scale of energies.
inline constexpr double largest_energy_defect = 0.02;

}  // namespace pendula::detail
