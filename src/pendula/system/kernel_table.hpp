#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/numeric/dual_functions.hpp>
#include <pendula/numeric/functions.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numbers_of_states.hpp>
#include <pendula/numeric/stage_product.hpp>
#include <pendula/system/kernel_numbers.hpp>
#include <pendula/system/kernel_series.hpp>
#include <pendula/system/system.hpp>
#include <pendula/system/system_model.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula {

namespace detail {

/// The functions of the generated kernel S for W states at once.
template <System S, int W>
class KernelFunctions : KernelNumbers<S, W> {
  using Crossing = KernelNumbers<S, W>;
  using Crossing::inputs, Crossing::parameters, Crossing::vector, Crossing::write, Crossing::write_columns;
  using Crossing::load, Crossing::store, Crossing::width;
  using typename Crossing::L, typename Crossing::Rows, typename Crossing::VariedRows;
  template <class Number>
  using Vector = typename S::template Vector<Number>;
  template <class Number>
  using Matrix = typename S::template Matrix<Number>;
  template <class Number>
  using Inputs = typename S::template Inputs<Number>;

 public:
  static constexpr SystemFunctions functions() {
    return {&hamiltonian_form,
            &momentum_form,
            &momentum_form_with_jacobians,
            &residual_with_jacobians,
            &momentum_from_velocity,
            &velocity_from_momentum,
            &acceleration,
            &mass_matrix,
            &energies,
            &power,
            &acceleration_along,
            &momentum_form_along,
            tells_arguments<S> ? &call_arguments : nullptr,
            has_constraints<S> ? &constraints : nullptr,
            has_constraints<S> ? &constraint_rates : nullptr,
            has_constraints<S> ? &constraint_rate_slopes : nullptr,
            has_constraints<S> ? &constraints_along : nullptr,
            has_constraints<S> ? &constraint_rates_along : nullptr,
            has_series<S> && W == 8 ? &KernelSeries<S, W>::start_along : nullptr,
            has_series<S> && W == 8 ? &KernelSeries<S, W>::next_along : nullptr,
            &iterate,
            has_series<S> ? &KernelSeries<S, W>::start : nullptr,
            has_series<S> ? &KernelSeries<S, W>::next : nullptr};
  }

  static void residual(const Conditions& at, const double* q, const double* v, const double* a, double* E) {
    Vector<L> found;
    S::residual(parameters(at), vector(q), vector(v), vector(a), inputs(at), found);
    write(found, E);
  }
  static void positions(const Conditions& at, const double* q, double* points) {
    if constexpr (has_points) {
      typename S::template Points<L> found;
      S::positions(parameters(at), vector(q), found);
      write_columns(found, points);
    }
  }
  static void velocities(const Conditions& at, const double* q, const double* v, double* velocities) {
    if constexpr (has_points) {
      typename S::template Points<L> found;
      S::velocities(parameters(at), vector(q), vector(v), found);
      write_columns(found, velocities);
    }
  }
  static void switches(const Conditions& at, const double* q, const double* v, double* g) {
    if constexpr (has_switches<S>) {
      typename S::template Switches<L> found;
      S::switches(parameters(at), vector(q), vector(v), inputs(at), found);
      write(found, g);
    }
  }
  static constexpr bool has_points = requires { &S::template positions<double>; };

 private:
  // --- The functions ---

  static void hamiltonian_form(const Conditions& at, const double* q, const double* p, double* v, double* f) {
    Vector<L> rates, forces;
    S::hamiltonian_form(parameters(at), vector(q), vector(p), inputs(at), rates, forces);
    write(rates, v);
    write(forces, f);
  }
  static void momentum_form(const Conditions& at, const double* q, const double* v, double* p, double* f) {
    Vector<L> momenta, forces;
    S::momentum_form(parameters(at), vector(q), vector(v), inputs(at), momenta, forces);
    write(momenta, p);
    write(forces, f);
  }
  static void momentum_form_with_jacobians(const Conditions& at, const double* q, const double* v, double* p, double* f,
                                           double* p_D_q, double* p_D_v, double* f_D_q, double* f_D_v) {
    Vector<L> momenta, forces;
    Matrix<L> momenta_q, momenta_v, forces_q, forces_v;
    S::momentum_form_with_jacobians(parameters(at), vector(q), vector(v), inputs(at), momenta, forces, momenta_q,
                                    momenta_v, forces_q, forces_v);
    write(momenta, p);
    write(forces, f);
    write(momenta_q, p_D_q);
    write(momenta_v, p_D_v);
    write(forces_q, f_D_q);
    write(forces_v, f_D_v);
  }
  static void residual_with_jacobians(const Conditions& at, const double* q, const double* v, const double* a,
                                      double* E, double* E_D_q, double* E_D_v, double* E_D_a) {
    Vector<L> found;
    Matrix<L> by_q, by_v, by_a;
    S::residual_with_jacobians(parameters(at), vector(q), vector(v), vector(a), inputs(at), found, by_q, by_v, by_a);
    write(found, E);
    write(by_q, E_D_q);
    write(by_v, E_D_v);
    write(by_a, E_D_a);
  }
  static void momentum_from_velocity(const Conditions& at, const double* q, const double* v, double* p) {
    Vector<L> found;
    S::momentum_from_velocity(parameters(at), vector(q), vector(v), found);
    write(found, p);
  }
  static void velocity_from_momentum(const Conditions& at, const double* q, const double* p, double* v) {
    Vector<L> found;
    S::velocity_from_momentum(parameters(at), vector(q), vector(p), found);
    write(found, v);
  }
  static void acceleration(const Conditions& at, const double* q, const double* v, double* a) {
    Vector<L> found;
    S::acceleration(parameters(at), vector(q), vector(v), inputs(at), found);
    write(found, a);
  }
  static void mass_matrix(const Conditions& at, const double* q, double* M) {
    Matrix<L> found;
    S::mass_matrix(parameters(at), vector(q), found);
    write(found, M);
  }
  static void energies(const Conditions& at, const double* q, const double* v, double* kinetic, double* total) {
    L found;
    S::kinetic_energy(parameters(at), vector(q), vector(v), found);
    store(found, kinetic);
    S::energy(parameters(at), vector(q), vector(v), found);
    store(found, total);
  }
  static void power(const Conditions& at, const double* q, const double* v, double* power) {
    L found;
    S::power(parameters(at), vector(q), vector(v), inputs(at), found);
    store(found, power);
  }
  static void call_arguments(const Conditions& at, const double* q, const double* v, double* arguments) {
    if constexpr (tells_arguments<S>) {
      typename S::template Arguments<L> found;
      S::call_arguments(parameters(at), vector(q), vector(v), inputs(at), found);
      write(found, arguments);
    }
  }

  static void constraints(const Conditions& at, const double* q, double* g, double* g_D_q) {
    if constexpr (has_constraints<S>) {
      typename S::template Constraints<L> found;
      typename S::template ConstraintSlopes<L> slopes;
      S::constraints(parameters(at), vector(q), found, slopes);
      write(found, g);
      write(slopes, g_D_q);
    }
  }
  static void constraint_rates(const Conditions& at, const double* q, const double* v, double* g_dot, double* g_ddot) {
    if constexpr (has_constraints<S>) {
      typename S::template Constraints<L> first, second;
      S::constraint_rates(parameters(at), vector(q), vector(v), first, second);
      write(first, g_dot);
      write(second, g_ddot);
    }
  }
  static void constraint_rate_slopes(const Conditions& at, const double* q, const double* v, double* g_dot_D_q) {
    if constexpr (has_constraints<S>) {
      typename S::template ConstraintSlopes<L> slopes;
      S::constraint_rate_slopes(parameters(at), vector(q), vector(v), slopes);
      write(slopes, g_dot_D_q);
    }
  }

  // --- Derivatives along a direction: the functions in dual numbers ---

  static void acceleration_along(const Conditions& at, const double* q, const double* v, const double* dq,
                                 const double* dv, double* a, double* da) {
    const Inputs<L> given = inputs(at);
    Inputs<Dual<L>> fixed;
    for (Eigen::Index k = 0; k < given.size(); ++k) fixed.data()[k] = Dual<L>(given.data()[k]);
    const auto parameters = Crossing::template read_parameters<Dual<L>>(Rows{at.parameters}, at);
    Vector<Dual<L>> found;
    S::acceleration(parameters, Crossing::template read<Vector<Dual<L>>>(VariedRows{q, dq}),
                    Crossing::template read<Vector<Dual<L>>>(VariedRows{v, dv}), fixed, found);
    for (Eigen::Index k = 0; k < found.size(); ++k) {
      store(found[k].value, a + k * W);
      store(found[k].slope, da + k * W);
    }
  }
  static void momentum_form_along(const Conditions& at, const double* varied_parameters, const double* varied_inputs,
                                  const double* q, const double* v, double* dp, double* df) {
    Vector<Dual<L>> momenta, forces;
    S::momentum_form(Crossing::template read_parameters<Dual<L>>(VariedRows{at.parameters, varied_parameters}, at),
                     unvaried(q), unvaried(v),
                     Crossing::template read<Inputs<Dual<L>>>(VariedRows{at.inputs, varied_inputs}), momenta, forces);
    for (Eigen::Index k = 0; k < momenta.size(); ++k) {
      store(momenta[k].slope, dp + k * W);
      store(forces[k].slope, df + k * W);
    }
  }

  static void constraints_along(const Conditions& at, const double* varied_parameters, const double* q, double* dg,
                                double* dg_D_q) {
    if constexpr (has_constraints<S>) {
      typename S::template Constraints<Dual<L>> found;
      typename S::template ConstraintSlopes<Dual<L>> slopes;
      S::constraints(Crossing::template read_parameters<Dual<L>>(VariedRows{at.parameters, varied_parameters}, at),
                     unvaried(q), found, slopes);
      for (Eigen::Index i = 0; i < found.rows(); ++i) {
        store(found(i, 0).slope, dg + i * W);
        for (Eigen::Index k = 0; k < slopes.cols(); ++k) {
          store(slopes(i, k).slope, dg_D_q + (i * slopes.cols() + k) * W);
        }
      }
    }
  }
  static void constraint_rates_along(const Conditions& at, const double* varied_parameters, const double* dq,
                                     const double* dv, const double* q, const double* v, double* dg_dot,
                                     double* dg_ddot) {
    if constexpr (has_constraints<S>) {
      typename S::template Constraints<Dual<L>> first, second;
      S::constraint_rates(Crossing::template read_parameters<Dual<L>>(VariedRows{at.parameters, varied_parameters}, at),
                          Crossing::template read<Vector<Dual<L>>>(VariedRows{q, dq}),
                          Crossing::template read<Vector<Dual<L>>>(VariedRows{v, dv}), first, second);
      for (Eigen::Index i = 0; i < first.rows(); ++i) {
        store(first(i, 0).slope, dg_dot + i * W);
        store(second(i, 0).slope, dg_ddot + i * W);
      }
    }
  }

  /// Coordinates or rates that do not vary.
  static Vector<Dual<L>> unvaried(const double* numbers) {
    const Vector<L> given = vector(numbers);
    Vector<Dual<L>> found;
    for (Eigen::Index k = 0; k < given.size(); ++k) found[k] = Dual<L>(given[k]);
    return found;
  }

  // --- The iteration, compiled with the kernel: for few coordinates a call of its functions would cost as much ---

  PENDULA_IN_REGISTERS static IterationChange iterate(const Conditions& at, const StageIteration& on) {
    constexpr std::size_t count = S::coordinates;
    using P = Pack<W, RegisterFor<W>>;
    const auto reached = [&](std::size_t k) {
      const Compensated<double>& start = on.start[k];
      return P(start.value) + stage_product<P, W, W>(on.m, on.increments + k * W, P(start.compensation));
    };
    Vector<L> Q, momenta, V, F;
    for (std::size_t k = 0; k < count; ++k) {
      Q[static_cast<Eigen::Index>(k)] = number(reached(k));
      momenta[static_cast<Eigen::Index>(k)] = number(reached(count + k));
    }
    S::hamiltonian_form(parameters(at), Q, momenta, inputs(at), V, F);
    const P hb = P::load(on.hb);
    P largest(0.0), scale(0.0), all(0.0);
    for (std::size_t k = 0; k < count; ++k) {
      const P weight(on.weights[k]), push_weight(on.weights[count + k]);
      double *const moved_at = on.increments + k * W, *const pushed_at = on.increments + (count + k) * W;
      const P moved = hb * P(pack(V[static_cast<Eigen::Index>(k)])),
              pushed = hb * P(pack(F[static_cast<Eigen::Index>(k)]));
      const P moved_change = moved - P::load(moved_at), pushed_change = pushed - P::load(pushed_at);
      largest = max(largest, max(weight * abs(moved_change), push_weight * abs(pushed_change)));
      scale = max(scale, max(weight * abs(moved), push_weight * abs(pushed)));
      all = all + (moved_change + pushed_change);
      moved.store(moved_at);
      pushed.store(pushed_at);
    }
    // A NaN change reaches the sum, though not always the maximum.
    if (!std::isfinite(total(all))) return {std::numeric_limits<double>::quiet_NaN(), largest_of(scale)};
    return {largest_of(largest), largest_of(scale)};
  }

  static L number(const Pack<W, RegisterFor<W>>& pack) {
    if constexpr (W == 1) {
      double number = 0;
      pack.store(&number);
      return number;
    } else {
      return pack;
    }
  }
  static Pack<W, RegisterFor<W>> pack(const L& number) { return Pack<W, RegisterFor<W>>(number); }

  static double largest_of(const Pack<W, RegisterFor<W>>& numbers) {
    alignas(pack_alignment) double each[width];
    numbers.store(each);
    return *std::max_element(each, each + W);
  }
  static double total(const Pack<W, RegisterFor<W>>& numbers) {
    alignas(pack_alignment) double each[width];
    numbers.store(each);
    double total = each[0];
    for (int k = 1; k < W; ++k) total += each[k];
    return total;
  }
};

template <System S>
constexpr PlainFunctions plain_functions() {
  using Functions = KernelFunctions<S, 1>;
  return {&Functions::residual, Functions::has_points ? &Functions::positions : nullptr,
          Functions::has_points ? &Functions::velocities : nullptr, has_switches<S> ? &Functions::switches : nullptr};
}

}  // namespace detail

/// The table of the generated kernel S.
template <System S>
inline constexpr SystemTable system_table = {info_of<S>(),
                                             nullptr,
                                             detail::KernelFunctions<S, 1>::functions(),
                                             detail::KernelFunctions<S, 2>::functions(),
                                             detail::KernelFunctions<S, 4>::functions(),
                                             detail::KernelFunctions<S, 8>::functions(),
                                             detail::plain_functions<S>()};

/// A model of the generated kernel S with `parameters` in the kernel's own layout (its time is ignored), constant
/// `inputs` (zero where null), and `sines` added to them.
template <System S>
SystemModel model_of(typename S::template Parameters<double> parameters,
                     const typename S::template Inputs<double>* inputs = nullptr, std::vector<InputSine> sines = {}) {
  std::array<double*, static_cast<std::size_t>(parameter_count<S>()) + 1> places{};
  S::template parameter_places<double>(parameters, places.data());
  SystemNumbers numbers;
  for (int k = 0; k < parameter_count<S>(); ++k) numbers.parameters.push_back(*places[static_cast<std::size_t>(k)]);
  numbers.inputs.assign(S::input_names.size(), 0.0);
  if (inputs != nullptr) std::copy_n(inputs->data(), numbers.inputs.size(), numbers.inputs.begin());
  numbers.sines = std::move(sines);
  return SystemModel(system_table<S>, numbers.plain());
}

}  // namespace pendula
