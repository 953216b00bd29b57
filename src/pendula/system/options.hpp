#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <ostream>
#include <string_view>

namespace pendula {

/// How time is advanced: implicit Gauss–Legendre, Radau IIA where damping is stiff, or an explicit method for
/// comparison (paper §3.2).
enum class Method { gauss, radau, rk4, dopri5, fehlberg78, bulirsch_stoer, taylor };

/// Which form of the equations Gauss–Legendre solves: (q, p) is symplectic, (q, q̇) is the paper's.
enum class Form { momentum, velocity };

/// Who solves the stage equations: the O(n) chain elimination, or a generated dense kernel.
enum class Solver { automatic, chain, dense };

/// How the stage equations are iterated.
enum class Iteration { automatic, newton, fixed_point };

constexpr bool is_explicit(Method method) {
  return method != Method::gauss && method != Method::radau;
}

/// Whether an explicit method chooses its steps; implicit ones do where no step is asked for.
constexpr bool is_adaptive(Method method) {
  return is_explicit(method) && method != Method::rk4;
}

/// What scenarios call the values of an option, in the order of its enumerators.
template <class Option>
inline constexpr std::array<std::string_view, 0> names_of{};
template <>
inline constexpr std::array<std::string_view, 7> names_of<Method>{"gauss",      "radau",          "rk4",   "dopri5",
                                                                  "fehlberg78", "bulirsch-stoer", "taylor"};
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

/// The option of that name; none where there is none of it.
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

/// What a run is asked to do.
struct RunOptions {
  Method method = Method::gauss;
  int stages = 2;  ///< gauss: 1..8, order 2·stages; radau: 2, 3, order 2·stages − 1; stages_for a tolerance
  Form form = Form::momentum;                  ///< gauss
  Solver solver = Solver::automatic;           ///< gauss
  Iteration iteration = Iteration::automatic;  ///< gauss
  double step = 1e-3;       ///< gauss, radau, rk4  [s]; 0, of gauss and radau: of their own choice, by tolerance
  double tolerance = 1e-9;  ///< gauss, radau: of the motion, relative to its size, but for what chaos makes of it;
                            ///< explicit adaptive ones: error a step, relative to coordinates and
                            ///< rates, at least to 1 or all the motion
};

/// Whether steps follow from the tolerance.
constexpr bool is_adaptive(const RunOptions& options) {
  return is_adaptive(options.method) || (!is_explicit(options.method) && options.step == 0);
}

/// Stages of the fewest evaluations for a tolerance.
constexpr int stages_for(Method method, double tolerance) {
  if (method == Method::radau) return 3;
  return tolerance > 1e-5 ? 4 : tolerance > 1e-8 ? 6 : 8;
}

}  // namespace pendula
