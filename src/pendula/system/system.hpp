#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <pendula/system/series_info.hpp>
#include <span>
#include <string_view>

namespace pendula {

/// What the runtime requires of a mechanical system: pure functions of parameters, coordinates q, rates v, momenta p
/// and inputs, with outputs by reference, for any number type. Generated kernels are such systems
/// (pendula_codegen/entry_points.py). A time on which they depend explicitly is among the parameters.
template <class S>
concept System = requires(const typename S::template Parameters<double>& parameters,
                          const typename S::template Vector<double>& x,
                          const typename S::template Inputs<double>& inputs, typename S::template Vector<double>& out,
                          typename S::template Matrix<double>& jacobian, double& number) {
  { S::name } -> std::convertible_to<std::string_view>;
  { S::coordinates } -> std::convertible_to<int>;
  { S::constant_masses } -> std::convertible_to<bool>;
  { S::coordinate_names[0] } -> std::convertible_to<std::string_view>;
  { S::coordinate_is_angle[0] } -> std::convertible_to<bool>;
  { S::coordinate_is_periodic[0] } -> std::convertible_to<bool>;
  S::kinetic_energy(parameters, x, x, number);
  S::energy(parameters, x, x, number);
  S::power(parameters, x, x, inputs, number);
  S::mass_matrix(parameters, x, jacobian);
  S::momentum_from_velocity(parameters, x, x, out);
  S::velocity_from_momentum(parameters, x, x, out);
  S::hamiltonian_form(parameters, x, x, inputs, out, out);
  S::momentum_form(parameters, x, x, inputs, out, out);
  S::momentum_form_with_jacobians(parameters, x, x, inputs, out, out, jacobian, jacobian, jacobian, jacobian);
  S::residual_with_jacobians(parameters, x, x, x, inputs, out, jacobian, jacobian, jacobian);
  S::acceleration(parameters, x, x, inputs, out);
};

/// Whether the functions of a system depend on time explicitly.
template <System S>
inline constexpr bool holds_time = requires(typename S::template Parameters<double>& parameters) {
  parameters.time;
};

/// How many numbers all parameters of a system have.
template <System S>
constexpr int parameter_count() {
  int count = 0;
  for (const int size : S::parameter_sizes) count += size;
  return count;
}

/// Whether a kernel provides the arguments of the model's functions (S::call_arguments), and of each whether it is the
/// base of a power (pendula_codegen/model_kernel.py).
template <class S>
inline constexpr bool tells_arguments = requires {
  S::argument_is_base;
};

/// For each of these arguments whether it is the base of a power; empty if the kernel does not provide them.
template <class S>
constexpr std::span<const bool> argument_bases() {
  if constexpr (tells_arguments<S>) return S::argument_is_base;
  return {};
}

/// Whether a kernel has switching functions (S::switches).
template <class S>
inline constexpr bool has_switches = requires {
  S::switch_names;
};

/// The names of the switching functions; empty if there are none.
template <class S>
constexpr std::span<const std::string_view> switch_names() {
  if constexpr (has_switches<S>) return S::switch_names;
  return {};
}

/// Whether a kernel has constraints (S::constraints).
template <class S>
inline constexpr bool has_constraints = requires {
  S::constraint_names;
};

/// What they are called, and their units; empty if there are none.
template <class S>
constexpr std::span<const std::string_view> constraint_names() {
  if constexpr (has_constraints<S>) return S::constraint_names;
  return {};
}
template <class S>
constexpr std::span<const std::string_view> constraint_units() {
  if constexpr (has_constraints<S>) return S::constraint_units;
  return {};
}
/// Which of them are of rates.
template <class S>
constexpr std::span<const bool> constraint_is_of_rates() {
  if constexpr (has_constraints<S>) return S::constraint_is_of_rates;
  return {};
}

/// What the points of a kernel are drawn as; empty if the kernel does not say.
template <class S>
constexpr std::span<const std::string_view> point_kinds() {
  if constexpr (requires { S::point_kinds; }) return S::point_kinds;
  return {};
}

/// What is drawn between points; connection_ends() has between which. Both are empty if there is nothing.
template <class S>
constexpr std::span<const std::string_view> connection_kinds() {
  if constexpr (requires { S::connection_kinds; }) return S::connection_kinds;
  return {};
}
template <class S>
constexpr std::span<const int> connection_ends() {
  if constexpr (requires { S::connection_ends; }) return S::connection_ends;
  return {};
}

/// Whether a kernel provides the Taylor series of its motions.
template <class S>
inline constexpr bool has_series = requires {
  S::series_sums;
};

/// The description of the Taylor series of a kernel.
template <class S>
constexpr SeriesInfo series_of() {
  if constexpr (has_series<S>) {
    return {S::series_has_momenta, static_cast<int>(S::series_sums.size()), S::series_operands, S::series_kept};
  }
  return {};
}

namespace detail {

template <class S>
inline constexpr auto sums_of_kernel = [] {
  std::array<SeriesSum, S::series_sums.size()> sums{};
  for (std::size_t k = 0; k < sums.size(); ++k) {
    const auto& [first, second] = S::series_sums[k];
    sums[k] = {static_cast<unsigned short>(first), static_cast<unsigned short>(second)};
  }
  return sums;
}();

}  // namespace detail

/// The sums of the Taylor series of a kernel.
template <class S>
constexpr std::span<const SeriesSum> series_sums_of() {
  if constexpr (has_series<S>) return detail::sums_of_kernel<S>;
  return {};
}

}  // namespace pendula
