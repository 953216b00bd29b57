#pragma once

/// When a solution of the stage equations may be one that is not the motion (Status::wrong_root).
namespace pendula::detail {

/// Beyond such a turn in one step the stage equations may have solutions that are no motion  [rad]: of rods, and of
/// systems whose masses are constant.
inline constexpr double largest_turn = 3;
/// The same where inertia may vanish: there a coordinate may move faster than everything else.
inline constexpr double largest_turn_by_inertia = 0.25;

constexpr double largest_turn_of(bool constant_masses) {
  return constant_masses ? largest_turn : largest_turn_by_inertia;
}

/// Where the first correction is larger than this, relative to the unknowns, or a link turns farther  [rad], the
/// iteration may have found such a solution: its energy is looked at.
inline constexpr double trusted_prediction = 0.02, trusted_turn = 0.5;
/// What a step of the motion may miss of its energy, relative to the scale of energies.
inline constexpr double largest_energy_defect = 0.02;

}  // namespace pendula::detail
