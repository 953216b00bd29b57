#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <ostream>
#include <string_view>

namespace pendula {

/// Time-stepping method. Implicit: Gauss–Legendre, and Radau IIA for stiff damping. The others are explicit: Taylor
/// series, and Runge–Kutta methods for comparison (paper §3.2).
enum class Method { gauss, radau, rk4, dopri5, fehlberg78, taylor };

/// Form of the equations that Gauss–Legendre solves: (q, p) is symplectic, (q, q̇) is the paper's.
enum class Form { momentum, velocity };

/// Solver of the stage equations: O(n) elimination along the chain, or a generated dense kernel.
enum class Solver { automatic, chain, dense };

/// Iteration on the stage equations.
enum class Iteration { automatic, newton, fixed_point };

constexpr bool is_explicit(Method method) {
  return method != Method::gauss && method != Method::radau;
}

/// Whether an explicit method chooses its step sizes; implicit methods do if no step is given.
constexpr bool is_adaptive(Method method) {
  return is_explicit(method) && method != Method::rk4;
}

/// Names of an option's values in scenarios, in the order of its enumerators.
template <class Option>
inline constexpr std::array<std::string_view, 0> names_of{};
template <>
inline constexpr std::array<std::string_view, 6> names_of<Method>{"gauss",  "radau",      "rk4",
                                                                  "dopri5", "fehlberg78", "taylor"};
template <>
inline constexpr std::array<std::string_view, 2> names_of<Form>{"momentum", "velocity"};
template <>
inline constexpr std::array<std::string_view, 3> names_of<Solver>{"auto", "chain", "dense"};
template <>
inline constexpr std::array<std::string_view, 3> names_of<Iteration>{"auto", "newton", "fixed-point"};

template <class Option>
requires(!names_of<Option>.empty()) constexpr std::string_view name_of(Option option) {
  return names_of<Option>[static_cast<std::size_t>(option)];
}

/// What to take for a value that earlier versions had; empty for others.
constexpr std::string_view instead_of(std::string_view gone) {
  return gone == "bulirsch-stoer" ? "fehlberg78" : "";
}

/// The option of that name, or nothing.
template <class Option>
requires(!names_of<Option>.empty()) constexpr std::optional<Option> option_of(std::string_view name) {
  for (std::size_t k = 0; k < names_of<Option>.size(); ++k) {
    if (names_of<Option>[k] == name) return static_cast<Option>(k);
  }
  return std::nullopt;
}

template <class Option>
requires(!names_of<Option>.empty()) std::ostream& operator<<(std::ostream& out, Option option) {
  return out << name_of(option);
}

/// Method and accuracy of a run.
struct RunOptions {
  Method method = Method::gauss;
  int stages = 2;              ///< gauss: 1..8, order 2·stages; radau: 2, 3, order 2·stages − 1; see stages_for
  Form form = Form::momentum;  ///< gauss
  Solver solver = Solver::automatic;           ///< gauss
  Iteration iteration = Iteration::automatic;  ///< gauss
  /// Step size of gauss, radau and rk4  [s]; with gauss and radau 0 means: chosen by the tolerance.
  double step = 1e-3;
  /// gauss, radau: error of the motion relative to its size, before its amplification by chaos. Explicit adaptive
  /// methods: error of a step relative to coordinates and rates; these count at least as 1, or as the whole motion.
  double tolerance = 1e-9;
};

/// The smallest tolerance of a step: of a smaller one rounding leaves nothing.
inline constexpr double smallest_tolerance = 1e-16;

/// Whether step sizes follow from the tolerance.
constexpr bool is_adaptive(const RunOptions& options) {
  return is_adaptive(options.method) || (!is_explicit(options.method) && options.step == 0);
}

/// The longest step that may be asked for  [s]; infinite where the tolerance limits them.
constexpr double longest_step(const RunOptions& options) {
  return is_adaptive(options) ? std::numeric_limits<double>::infinity() : options.step;
}

/// The number of stages that takes the least time for a tolerance. Six take 0.95 to 1.8 times what eight take from 1e-5
/// down (medians, AVX-512: planar chain of 2 links, spatial of 8, swinging Atwood machine).
constexpr int stages_for(Method method, double tolerance) {
  if (method == Method::radau) return 3;
  return tolerance > 1e-5 ? 4 : 8;
}

}  // namespace pendula
