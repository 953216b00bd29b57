#pragma once

#include <array>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula {

/// Functions of a model that its kernel computes, as pendula_codegen/written.py has them; matrices row by row.
enum class Written {
  kinetic_energy,
  energy,
  mass,
  momenta,
  forces,  ///< ∂L/∂q + Q
  momenta_q,
  forces_q,
  forces_v,
  residual,  ///< E
  residual_q,
  residual_v,
  power,
  positions,
  velocities,
  momenta_at_rest,   ///< ∂L/∂v at v = 0
  residual_at_rest,  ///< E at a = 0
};
inline constexpr int written_count = 16;

/// Numbers of one of them, of a system of n coordinates and so many components of points.
constexpr int written_size(Written what, int n, int point_components) {
  switch (what) {
    case Written::kinetic_energy:
    case Written::energy:
    case Written::power:
      return 1;
    case Written::mass:
    case Written::momenta_q:
    case Written::forces_q:
    case Written::forces_v:
    case Written::residual_q:
    case Written::residual_v:
      return n * n;
    case Written::positions:
    case Written::velocities:
      return point_components;
    default:
      return n;
  }
}

/// What evaluate_kernel writes, in this order: some of it several times, by each function of the kernel that has it.
inline constexpr std::array kernel_outputs = {
    Written::kinetic_energy, Written::energy,     Written::mass,        // each by a function of that name
    Written::momenta,                                                   // momentum_from_velocity
    Written::momenta,        Written::forces,                           // momentum_form
    Written::momenta,        Written::forces,     Written::momenta_q,   // momentum_form_with_jacobians
    Written::mass,           Written::forces_q,   Written::forces_v,    //
    Written::residual,                                                  // residual
    Written::residual,       Written::residual_q, Written::residual_v,  // residual_with_jacobians
    Written::mass,           Written::power,      Written::positions,  Written::velocities};

/// And what it writes after that, each of n numbers: what equations are solved for.
enum class Solved {
  accelerations,
  rates,              ///< velocity_from_momentum, of the momenta that momentum_from_velocity has
  hamiltonian_rates,  ///< hamiltonian_form, of the same
  hamiltonian_forces,
};
inline constexpr int solved_count = 4;

/// Every function of a kernel at one point of a system without sines.
void evaluate_kernel(const SystemTable& table, const PlainSystem& system, double time, const double* q, const double* v,
                     const double* a, double* values);

}  // namespace pendula
