#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/stage_system.hpp>
#include <pendula/system/system_model.hpp>

namespace pendula {

/// Newton's iteration on the stages of any system, in the form of its equations. Its matrix is exact, from the kernel's
/// generated Jacobians.
template <int Width, class Form>
class LagrangianNewton {
 public:
  using Stages = LagrangianStages<Width, Form>;
  using L = typename Stages::L;

  LagrangianNewton(const SystemModel& model, int stages)
      : system_(model.coordinates() + model.info().constraints.size(), stages), equations_(model.coordinates()) {}

  /// Improves the unknowns once. What follows from them is as it was before the correction.
  Correction correct(Stages& stages) {
    equations_.linearize(stages);
    stages.follow_constraints(true);
    for (std::size_t row = 0; row < equations_.count(); ++row) {
      system_.set_residual(row, stages.free_of_constraints(row, equations_.residual(stages, row)));
      for (std::size_t column = 0; column < equations_.count(); ++column) {
        for (std::size_t k = 0; k < system_.stages(); ++k) {
          const L derivative = equations_.derivative(stages.columns(), row, column, k);
          system_.set_derivative(row, column, k, stages.free_of_constraints(row, column, k, derivative));
        }
      }
    }
    if (stages.is_constrained()) constrain(stages);
    system_.solve();
    return apply(stages);
  }

  /// Computes what follows from the unknowns as they are.
  void follow(Stages& stages) {
    equations_.follow(stages);
    stages.follow_constraints(false);
  }

 private:
  // Constraints are further rows, at the nodes 1 … s, and their impulses at the nodes 0 … s − 1 further unknowns.
  void constrain(const Stages& stages) {
    const auto& constraints = stages.constraints();
    const std::size_t count = equations_.count();
    for (std::size_t i = 0; i < constraints.count(); ++i) {
      system_.set_residual(count + i, constraints.lacking(i));
      for (std::size_t k = 0; k < system_.stages(); ++k) {
        const L hb(stages.columns().hb(k));
        for (std::size_t column = 0; column < count; ++column) {
          system_.set_derivative(count + i, column, k, hb * constraints.lacking_by(stages.columns(), i, column, k));
          system_.set_derivative(column, count + i, k, L(0.0) - constraints.pushed_by(column, i, k));
        }
        for (std::size_t j = 0; j < constraints.count(); ++j) {
          const L soft = L(i == j ? constraints.softness(i) : 0.0) * stages.columns().unit(k);
          system_.set_derivative(count + i, count + j, k, soft);
        }
      }
    }
  }

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
      stages.correct_impulses(
          i, [&](std::size_t constraint) { return system_.correction(equations_.count() + constraint, i); });
    }
    return {stages.relative(largest, scale), worst};
  }

  detail::StageSystem system_;
  typename Form::template Equations<Width> equations_;
};

}  // namespace pendula
