#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/system/kernel_checks.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Quantities of a model that its kernel computes, as pendula_codegen/written.py lists them; matrices row by row.
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
  constraints,
  constraints_q,
  constraint_rates,
  constraint_second_rates,  ///< at a = 0
  constraint_rates_q,
};
inline constexpr int written_count = 21;

/// How many numbers a quantity has, for a system of n coordinates.
constexpr int written_size(Written what, int n, int point_components, int constraints) {
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
    case Written::constraints:
    case Written::constraint_rates:
    case Written::constraint_second_rates:
      return constraints;
    case Written::constraints_q:
    case Written::constraint_rates_q:
      return constraints * n;
    default:
      return n;
  }
}

/// The order in which evaluate_kernel writes. A quantity occurs several times if several functions of a kernel return
/// it.
inline constexpr std::array kernel_outputs = {Written::kinetic_energy,
                                              Written::energy,
                                              Written::mass,     // a function each
                                              Written::momenta,  // momentum_from_velocity
                                              Written::momenta,
                                              Written::forces,  // momentum_form
                                              Written::momenta,
                                              Written::forces,
                                              Written::momenta_q,  // momentum_form_with_jacobians
                                              Written::mass,
                                              Written::forces_q,
                                              Written::forces_v,  //
                                              Written::residual,  // residual
                                              Written::residual,
                                              Written::residual_q,
                                              Written::residual_v,  // residual_with_jacobians
                                              Written::mass,
                                              Written::power,
                                              Written::positions,
                                              Written::velocities,
                                              Written::constraints,
                                              Written::constraints_q,  // constraints
                                              Written::constraint_rates,
                                              Written::constraint_second_rates,
                                              Written::constraint_rates_q};

/// What evaluate_kernel writes after these, n numbers each: solutions of linear systems.
enum class Solved {
  accelerations,
  rates,              ///< velocity_from_momentum of the momenta that momentum_from_velocity returns
  hamiltonian_rates,  ///< hamiltonian_form of the same momenta
  hamiltonian_forces,
};
inline constexpr int solved_count = 4;

/// Evaluates every function of a kernel at one point; sines of the inputs are ignored.
void evaluate_kernel(const SystemTable& table, const PlainSystem& system, double time, const double* q, const double* v,
                     const double* a, double* values);

/// Compares a kernel with the expressions of its model at several points. Errors are in units of the rounding error of
/// the model's own expressions, with each operation rounded once.
class KernelComparison {
 public:
  /// `said` are the numbers that `python -m pendula_codegen written` writes. Throws std::invalid_argument if they
  /// belong to another model. Both arguments must outlive this object.
  KernelComparison(const SystemTable& table, std::span<const double> said);

  /// Rounding error of the energy at the first point  [J].
  double energy_rounding() const { return count_ == 0 ? 0 : std::abs(truth(0, Written::energy, 0).error); }

  std::vector<KernelLine> check() const;

 private:
  static constexpr double rounding = std::numeric_limits<double>::epsilon() / 2;

  struct Truth {
    double value, error;

    bool is_known() const { return !std::isnan(value); }
    double size() const { return error + rounding * std::abs(value); }
    double roundings(double computed) const { return computed == value ? 0 : std::abs(computed - value) / size(); }
  };

  int size(Written what) const { return written_size(what, n_, components_, constraints_); }
  const double* arguments(std::size_t point) const { return said_.data() + 1 + point * point_size_; }
  Truth truth(std::size_t point, Written what, int k) const {
    const double* pair = arguments(point) + arguments_ + 2 * (places_[static_cast<std::size_t>(what)] + k);
    return {pair[0], pair[1]};
  }

  std::size_t place(Written what) const;
  template <class Keep>
  void compare_solved(std::size_t point, const std::vector<double>& values, const Keep& keep) const;

  const SystemTable& table_;
  std::span<const double> said_;
  int n_, components_, parameters_, inputs_, constraints_;
  int arguments_ = 0, outputs_ = 0;
  std::size_t point_size_ = 0, count_ = 0;
  std::array<int, written_count> places_{};
};

}  // namespace pendula
