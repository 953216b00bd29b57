#pragma once

#include <ostream>
#include <string_view>

namespace pendula {

/// How time is advanced: implicit Gauss–Legendre, Radau IIA where damping is stiff, or an explicit method for
/// comparison (paper §3.2).
enum class Method { gauss, radau, rk4, dopri5, fehlberg78 };

/// Which form of the equations Gauss–Legendre solves: (q, p) is symplectic, (q, q̇) is the paper's.
enum class Form { momentum, velocity };

/// Who solves the stage equations: the O(n) chain elimination, or a generated dense kernel.
enum class Solver { automatic, chain, dense };

/// How the stage equations are iterated.
enum class Iteration { automatic, newton, fixed_point };

constexpr bool is_explicit(Method method) {
  return method != Method::gauss && method != Method::radau;
}

constexpr bool is_adaptive(Method method) {
  return method == Method::dopri5 || method == Method::fehlberg78;
}

inline std::ostream& operator<<(std::ostream& out, Method method) {
  switch (method) {
    case Method::gauss:
      return out << "gauss";
    case Method::radau:
      return out << "radau";
    case Method::rk4:
      return out << "rk4";
    case Method::dopri5:
      return out << "dopri5";
    case Method::fehlberg78:
      return out << "fehlberg78";
  }
  return out;
}

inline std::ostream& operator<<(std::ostream& out, Form form) {
  return out << (form == Form::momentum ? "momentum" : "velocity");
}

inline std::ostream& operator<<(std::ostream& out, Solver solver) {
  switch (solver) {
    case Solver::automatic:
      return out << "auto";
    case Solver::chain:
      return out << "chain";
    case Solver::dense:
      return out << "dense";
  }
  return out;
}

constexpr std::string_view name_of(Iteration iteration) {
  switch (iteration) {
    case Iteration::automatic:
      return "auto";
    case Iteration::newton:
      return "newton";
    case Iteration::fixed_point:
      return "fixed-point";
  }
  return "";
}

inline std::ostream& operator<<(std::ostream& out, Iteration iteration) {
  return out << name_of(iteration);
}

/// What a run is asked to do.
struct RunOptions {
  Method method = Method::gauss;
  int stages = 2;                              ///< gauss: 1..8, order 2·stages; radau: 2, 3, order 2·stages − 1
  Form form = Form::momentum;                  ///< gauss
  Solver solver = Solver::automatic;           ///< gauss
  Iteration iteration = Iteration::automatic;  ///< gauss
  double step = 1e-3;                          ///< gauss, rk4  [s]
  double tolerance = 1e-9;                     ///< dopri5, fehlberg78: error a step, relative and absolute
};

}  // namespace pendula
