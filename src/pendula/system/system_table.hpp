#pragma once

#include <pendula/numeric/compensated.hpp>
#include <pendula/system/plain_system.hpp>
#include <span>
#include <type_traits>

namespace pendula {

/// What functions of W states are taken at besides the states. Here and below numbers of W states lie side by side,
/// those of one parameter, coordinate … after those of the one before, matrices row by row, aligned to
/// `pack_alignment`.
struct Conditions {
  const void* context;       ///< SystemTable::context
  const double* parameters;  ///< (parameters, W)
  const double* times;       ///< (W)  [s]
  const double* inputs;      ///< (inputs, W)
};

/// One fixed-point iteration on the stages of a step, W stages at once (gauss/lagrangian_stages.hpp). Stages are held
/// as increments, h b v of a coordinate and h b f of its momentum.
struct StageIteration {
  const double* m;                   ///< (W, W): column by column m_ij = a_ij / b_j
  const double* hb;                  ///< (W): h b_j, zero beyond the stages
  const Compensated<double>* start;  ///< (2 coordinates): coordinates, then momenta, where the step begins
  const double* weights;             ///< (2 coordinates): of changes, as they are compared
  double* increments;                ///< (2 coordinates, W): of coordinates, then of momenta; replaced
};

/// What an iteration did.
struct IterationChange {
  double change;  ///< the largest weighed change of an increment; NaN where one is not finite
  double size;    ///< the largest weighed increment
};

/// The functions of a kernel, of W states at once, as generated kernels have them (pendula_codegen/entry_points.py).
/// Outputs come last and overlap nothing.
struct SystemFunctions {
  using Numbers = const double*;

  void (*hamiltonian_form)(const Conditions&, Numbers q, Numbers p, double* v, double* f);
  void (*momentum_form)(const Conditions&, Numbers q, Numbers v, double* p, double* f);
  void (*momentum_form_with_jacobians)(const Conditions&, Numbers q, Numbers v, double* p, double* f, double* p_D_q,
                                       double* p_D_v, double* f_D_q, double* f_D_v);
  void (*residual_with_jacobians)(const Conditions&, Numbers q, Numbers v, Numbers a, double* E, double* E_D_q,
                                  double* E_D_v, double* E_D_a);
  void (*momentum_from_velocity)(const Conditions&, Numbers q, Numbers v, double* p);
  void (*velocity_from_momentum)(const Conditions&, Numbers q, Numbers p, double* v);
  void (*acceleration)(const Conditions&, Numbers q, Numbers v, double* a);
  void (*mass_matrix)(const Conditions&, Numbers q, double* M);
  void (*energies)(const Conditions&, Numbers q, Numbers v, double* kinetic, double* total);
  void (*power)(const Conditions&, Numbers q, Numbers v, double* power);

  /// Acceleration, and its derivative along a tangent (dq, dv) of each state.
  void (*acceleration_along)(const Conditions&, Numbers q, Numbers v, Numbers dq, Numbers dv, double* a, double* da);
  /// The derivatives of momentum_form along variations of parameters and inputs.
  void (*momentum_form_along)(const Conditions&, Numbers parameters, Numbers inputs, Numbers q, Numbers v, double* dp,
                              double* df);
  /// What functions of the model are taken of, (arguments, W) (field_look.hpp); none where they are not told.
  void (*call_arguments)(const Conditions&, Numbers q, Numbers v, double* found);

  IterationChange (*iterate)(const Conditions&, const StageIteration&);
};

/// Functions of one state that are not asked for within steps.
struct PlainFunctions {
  using Numbers = const double*;

  void (*residual)(const Conditions&, Numbers q, Numbers v, Numbers a, double* E);
  /// Of points and their velocities, components of one after those of the one before; none where there are no points.
  void (*positions)(const Conditions&, Numbers q, double* points);
  void (*velocities)(const Conditions&, Numbers q, Numbers v, double* velocities);
};

/// What kernels of chains have besides, to check them by (kernel_check.hpp).
struct ChainFunctions {
  using Numbers = const double*;

  void (*residual_D_q)(const Conditions&, Numbers q, Numbers v, Numbers a, double* E_D_q);
  void (*residual_D_v)(const Conditions&, Numbers q, Numbers v, Numbers a, double* E_D_v);
  void (*residual_D_a)(const Conditions&, Numbers q, Numbers v, Numbers a, double* E_D_a);
  void (*force)(const Conditions&, Numbers q, Numbers v, double* Q);
  void (*force_with_jacobians)(const Conditions&, Numbers q, Numbers v, double* Q, double* Q_D_q, double* Q_D_v);
  void (*potential_energy)(const Conditions&, Numbers q, double* U);
  void (*lagrangian)(const Conditions&, Numbers q, Numbers v, double* L);
  void (*lagrangian_gradient)(const Conditions&, Numbers q, Numbers v, double* L_D_q, double* L_D_v);
  void (*lagrangian_hessian)(const Conditions&, Numbers q, Numbers v, double* L_D_qq, double* L_D_qv, double* L_D_vv);
  void (*hamiltonian)(const Conditions&, Numbers q, Numbers p, double* H);
};

/// A mechanical system as the runtime meets it: what it says of itself, and its functions. All that is compiled from a
/// generated kernel (kernel_table.hpp).
struct SystemTable {
  SystemInfo info;
  const void* context;  ///< handed to its functions
  SystemFunctions of_1, of_2, of_4, of_8;
  PlainFunctions plain;
  const ChainFunctions* chain;  ///< none where it is no chain
};
static_assert(std::is_trivially_copyable_v<SystemTable> && std::is_standard_layout_v<SystemTable>);

/// Its functions of so many states at once: 1, 2, 4 or 8.
template <int W>
const SystemFunctions& functions_of(const SystemTable& table) {
  static_assert(W == 1 || W == 2 || W == 4 || W == 8);
  return W == 1 ? table.of_1 : W == 2 ? table.of_2 : W == 4 ? table.of_4 : table.of_8;
}

/// Layout of what crosses to a kernel that was compiled by itself: SystemTable and all that it leads to.
inline constexpr int system_interface = 10;

}  // namespace pendula
