#pragma once

#include <cstddef>
#include <pendula/system/system_table.hpp>

namespace pendula {

template <int Width>
class LagrangianJacobians;

/// The form of the equations of motion in which Gauss methods are symplectic: q̇ = v, ṗ = ∂L/∂q + Q, p = ∂L/∂v.
///
/// A form says what moves beside the coordinates (here momenta, in VelocityForm rates) and how Newton solves the
/// stages. `call(function, numbers…)` calls a function of the system; there are `count` numbers of each kind.
struct MomentumForm {
  static constexpr bool is_symplectic = true, has_fixed_point = true;
  static constexpr int unknown = 0;  ///< what Newton solves for: rates (0), or what changes momenta (1)
  /// The stage equations of Newton.
  template <int Width>
  using Equations = LagrangianJacobians<Width>;

  template <class Call>
  static void from_rates(Call&& call, std::size_t /*count*/, const double* q, const double* v, double* p) {
    call(&SystemFunctions::momentum_from_velocity, q, v, p);
  }
  template <class Call>
  static void rates(Call&& call, std::size_t /*count*/, const double* q, const double* p, double* v) {
    call(&SystemFunctions::velocity_from_momentum, q, p, v);
  }
  /// Rates of change of both.
  template <class Call>
  static void field(Call&& call, std::size_t /*count*/, const double* q, const double* p, double* v, double* f) {
    call(&SystemFunctions::hamiltonian_form, q, p, v, f);
  }

  /// Size of a change of the momentum of a coordinate, comparable with √M_kk v_k, where `weight` is √M_kk.
  static double size(double change, double weight) { return change / weight; }
};

}  // namespace pendula
