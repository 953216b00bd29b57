#pragma once

#include <pendula/system/series_info.hpp>
#include <pendula/system/system.hpp>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace pendula {

/// A sine added to one input: amplitude · sin(frequency t + phase).
struct InputSine {
  int input;         ///< 0-based
  double amplitude;  ///< in the unit of the input
  double frequency;  ///< rad/s
  double phase;      ///< rad
};

/// Parameters and inputs of a system as they cross from a program to compiled code (run/library.hpp). The memory
/// belongs to the caller.
struct PlainSystem {
  const double* parameters;  ///< concatenated, in the order of the kernel's parameter_names
  const double* inputs;      ///< constant part of each, in the order of its input_names
  std::span<const InputSine> sines;
};
static_assert(std::is_trivially_copyable_v<PlainSystem> && std::is_standard_layout_v<PlainSystem>);

/// The same with the memory that holds the numbers.
struct SystemNumbers {
  std::vector<double> parameters, inputs;  ///< in the order of SystemInfo; inputs are their constant part
  std::vector<InputSine> sines;

  /// Valid as long as this object.
  PlainSystem plain() const { return {parameters.data(), inputs.data(), sines}; }
};

/// Description of a kernel, as it crosses from compiled code to a program.
struct SystemInfo {
  std::string_view name;   ///< "cart_chain_2"
  std::string_view model;  ///< "cart_chain"
  int links = 1;
  std::span<const std::string_view> coordinates, coordinate_units;
  std::span<const bool> is_angle, is_periodic;
  std::span<const std::string_view> parameters, parameter_units;
  std::span<const int> parameter_sizes;
  std::span<const double> parameter_defaults;  ///< NaN where there is none
  std::span<const bool> is_positive, is_per_link;
  std::span<const std::string_view> inputs, input_units;
  std::span<const std::string_view> points;
  std::span<const int> point_sizes;  ///< components of each
  bool depends_on_time;              ///< functions depend on time other than through inputs
  bool constant_masses;              ///< whether the pivots of the mass matrix are constant
  /// For each argument of the model's functions that may change fast: whether it is the base of a power
  /// (field_look.hpp).
  std::span<const bool> argument_is_base;
  /// The switching functions (PlainFunctions::switches), as text. The last parameters are two for each of them, 1 or 0:
  /// whether it is > 0, whether it is < 0.
  std::span<const std::string_view> switches;
  SeriesInfo series;
  /// What points are drawn as: "bob", "cart", "pivot", "weight" or "floor"; empty: all are bobs.
  std::span<const std::string_view> point_kinds;
  std::span<const std::string_view> connection_kinds;  ///< "rod", "spring", "thread" or "pulleys"
  std::span<const int> connection_ends;                ///< two for each connection: 0-based points, -1 is the origin
  std::span<const SeriesSum> series_sums;              ///< (SeriesInfo::sums)
  /// What is 0 at all times (SystemFunctions::constraints).
  std::span<const std::string_view> constraints, constraint_units;
  std::span<const bool> constraint_is_of_rates;  ///< whether it is A v + b, else g(q, t)

  /// Number of parameters of the model itself, without the last ones, which tell the sides of switching functions.
  std::size_t own_parameters() const { return parameters.size() - 2 * switches.size(); }
};

/// The description of the generated kernel S.
template <System S>
constexpr SystemInfo info_of() {
  return {S::name,
          S::model,
          S::links,
          S::coordinate_names,
          S::coordinate_units,
          S::coordinate_is_angle,
          S::coordinate_is_periodic,
          S::parameter_names,
          S::parameter_units,
          S::parameter_sizes,
          S::parameter_defaults,
          S::parameter_is_positive,
          S::parameter_is_per_link,
          S::input_names,
          S::input_units,
          S::point_names,
          S::point_sizes,
          holds_time<S>,
          S::constant_masses,
          argument_bases<S>(),
          switch_names<S>(),
          series_of<S>(),
          point_kinds<S>(),
          connection_kinds<S>(),
          connection_ends<S>(),
          series_sums_of<S>(),
          constraint_names<S>(),
          constraint_units<S>(),
          constraint_is_of_rates<S>()};
}

}  // namespace pendula
