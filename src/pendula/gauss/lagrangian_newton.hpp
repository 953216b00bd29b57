#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/stage_system.hpp>

namespace pendula {

/// Newton's iteration on the stages of any system, in the form of its equations. Its matrix is exact, from the kernel's
/// generated Jacobians.
template <int Width, class Form>
class LagrangianNewton {
 public:
  using Stages = LagrangianStages<Width, Form>;

  LagrangianNewton(std::size_t coordinates, int stages) : system_(coordinates, stages), equations_(coordinates) {}

  /// Improves the unknowns once. What follows from them is as it was before the correction.
  Correction correct(Stages& stages) {
    equations_.linearize(stages);
    for (std::size_t row = 0; row < equations_.count(); ++row) {
      system_.set_residual(row, equations_.residual(stages, row));
      for (std::size_t column = 0; column < equations_.count(); ++column) {
        for (std::size_t k = 0; k < system_.stages(); ++k) {
          system_.set_derivative(row, column, k, equations_.derivative(stages.columns(), row, column, k));
        }
      }
    }
    system_.solve();
    return apply(stages);
  }

  /// Computes what follows from the unknowns as they are.
  void follow(Stages& stages) { equations_.follow(stages); }

 private:
  Correction apply(Stages& stages) {
    double largest = 0, scale = stages.floor();
    int worst = -1;
    for (std::size_t i = 0; i < system_.stages(); ++i) {
      for (std::size_t k = 0; k < equations_.count(); ++k) {
        const double advance = stages.columns().hb(i) * system_.correction(k, i);
        if (!std::isfinite(advance)) return {std::numeric_limits<double>::quiet_NaN(), static_cast<int>(k)};
        stages.increments(Form::unknown, k)[i] -= advance;
        scale = std::max({scale, stages.size(0, k, stages.moved(k)[i]), stages.size(1, k, stages.pushed(k)[i])});
        const double size = stages.size(Form::unknown, k, advance);
        if (size < largest) continue;
        largest = size;
        worst = static_cast<int>(k);
      }
    }
    return {largest > 0 ? largest / scale : 0, worst};
  }

  detail::StageSystem system_;
  typename Form::template Equations<Width> equations_;
};

}  // namespace pendula
