#pragma once

#include <pendula/numeric/compensated.hpp>
#include <pendula/system/plain_system.hpp>
#include <span>
#include <type_traits>

namespace pendula {

/// What functions of W states depend on besides the states. Here and below, numbers of W states lie side by side,
/// parameter after parameter, coordinate after coordinate, matrices row by row; all aligned to `pack_alignment`.
struct Conditions {
  const void* context;       ///< SystemTable::context
  const double* parameters;  ///< (parameters, W)
  const double* times;       ///< (W)  [s]
  const double* inputs;      ///< (inputs, W)
};

/// One fixed-point iteration on W stages of a step at once (gauss/lagrangian_stages.hpp). The unknowns of a stage are
/// increments: h b v for a coordinate, h b f for its momentum.
struct StageIteration {
  const double* m;                   ///< (W, W): column by column m_ij = a_ij / b_j
  const double* hb;                  ///< (W): h b_j, zero beyond the last stage
  const Compensated<double>* start;  ///< (2 coordinates): coordinates, then momenta, at the start of the step
  const double* weights;             ///< (2 coordinates): of changes, in their comparison
  double* increments;                ///< (2 coordinates, W): for coordinates, then momenta; replaced
};

/// Result of an iteration.
struct IterationChange {
  double change;  ///< the largest weighted change of an increment; NaN if one is not finite
  double size;    ///< the largest weighted increment
};

/// Taylor series of W motions about their states: Σ c_k τ^k at the time t + unit τ. Rows of coefficients, order after
/// order; how long they are says series_info.hpp. The memory belongs to the caller.
struct SeriesRows {
  const double* unit;  ///< (W)  [s]
  double* state;       ///< (order + 1, row): of q, then of p, or of v where there are no momenta
  double* kept;        ///< (SeriesInfo::kept, W)
  double* operands;    ///< (order, row): the first row is not used
};

/// The functions of a kernel for W states at once, as generated kernels define them (pendula_codegen/entry_points.py).
/// Outputs come last, and overlap no other array.
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

  /// Acceleration and its derivative along a tangent (dq, dv) of each state.
  void (*acceleration_along)(const Conditions&, Numbers q, Numbers v, Numbers dq, Numbers dv, double* a, double* da);
  /// Derivatives of momentum_form along variations of parameters and inputs.
  void (*momentum_form_along)(const Conditions&, Numbers parameters, Numbers inputs, Numbers q, Numbers v, double* dp,
                              double* df);
  /// Arguments of the model's functions, (arguments, W) (field_look.hpp); null if the kernel does not provide them.
  void (*call_arguments)(const Conditions&, Numbers q, Numbers v, double* found);
  /// What is 0 at all times, g(q, t), (constraints, W), and ∂g/∂q; forces (∂g/∂q)ᵀ λ keep it so. Of a constraint of
  /// rates, A(q, t) v + b(q, t) = 0, g is 0, ∂g/∂q is A, and dg/dt is A v + b. This and the next four are null without
  /// constraints.
  void (*constraints)(const Conditions&, Numbers q, double* g, double* g_D_q);
  /// dg/dt, and d²g/dt² where nothing accelerates.
  void (*constraint_rates)(const Conditions&, Numbers q, Numbers v, double* g_dot, double* g_ddot);
  /// ∂(dg/dt)/∂q, where rates are the same.
  void (*constraint_rate_slopes)(const Conditions&, Numbers q, Numbers v, double* g_dot_D_q);
  /// Derivatives of g and ∂g/∂q along a variation of parameters; of what constraint_rates gives also along (dq, dv).
  void (*constraints_along)(const Conditions&, Numbers parameters, Numbers q, double* dg, double* dg_D_q);
  void (*constraint_rates_along)(const Conditions&, Numbers parameters, Numbers dq, Numbers dv, Numbers q, Numbers v,
                                 double* dg_dot, double* dg_ddot);
  /// Orders of Taylor series, and how they change where parameters, inputs and states do: series_start, and one order k
  /// of series_next, whose `order` is (k, 1/k, unit/(k + 1), time), (4, W), and whose `sums` are Σ A_j B_(k−j),
  /// (SeriesInfo::sums, W); inputs are those of order k. Rows of `state`, `next` and `operands` are those of W motions.
  /// Null without series, for more than ten coordinates, and in kernels in C++ for W < 8.
  void (*series_start_along)(const Conditions&, Numbers unit, Numbers state, Numbers d_parameters, Numbers d_inputs,
                             Numbers d_state, double* next, double* kept, double* d_next, double* d_kept);
  void (*series_next_along)(const Conditions&, Numbers order, Numbers state, Numbers kept, Numbers sums,
                            Numbers d_state, Numbers d_kept, Numbers d_sums, double* next, double* operands,
                            double* d_next, double* d_operands);

  IterationChange (*iterate)(const Conditions&, const StageIteration&);

  /// Reads row 0 of the state, and gives row 1 and what is kept. This and the next one are null if the kernel has no
  /// series.
  void (*series_start)(const Conditions&, const SeriesRows&);
  /// From rows up to `first` of the state gives rows first + 1 … last + 1, and rows first … last of the operands;
  /// first ≥ 1. Here Conditions::inputs has the coefficients of the inputs, (last + 1, inputs, W).
  void (*series_next)(const Conditions&, const SeriesRows&, int first, int last);
};

/// Functions of one state that are not needed within steps.
struct PlainFunctions {
  using Numbers = const double*;

  void (*residual)(const Conditions&, Numbers q, Numbers v, Numbers a, double* E);
  /// Positions and velocities of points, point after point; null if the model has no points.
  void (*positions)(const Conditions&, Numbers q, double* points);
  void (*velocities)(const Conditions&, Numbers q, Numbers v, double* velocities);
  /// Switching functions, between whose zeros a kernel is smooth (SystemInfo::switches); null if there are none.
  void (*switches)(const Conditions&, Numbers q, Numbers v, double* g);
};

/// A mechanical system as the runtime sees it: its description and its functions, all that is compiled from a generated
/// kernel (kernel_table.hpp).
struct SystemTable {
  SystemInfo info;
  const void* context;  ///< passed to its functions
  SystemFunctions of_1, of_2, of_4, of_8;
  PlainFunctions plain;
};
static_assert(std::is_trivially_copyable_v<SystemTable> && std::is_standard_layout_v<SystemTable>);

/// The functions of W states at once: W = 1, 2, 4 or 8.
template <int W>
const SystemFunctions& functions_of(const SystemTable& table) {
  static_assert(W == 1 || W == 2 || W == 4 || W == 8);
  return W == 1 ? table.of_1 : W == 2 ? table.of_2 : W == 4 ? table.of_4 : table.of_8;
}

/// Version of the layout that crosses to a separately compiled kernel: SystemTable and everything that it points to.
inline constexpr int system_interface = 19;

}  // namespace pendula
