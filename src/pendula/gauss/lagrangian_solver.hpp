#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <pendula/gauss/lagrangian_field.hpp>
#include <pendula/gauss/lagrangian_newton.hpp>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/lagrangian_tangent.hpp>
#include <pendula/gauss/momentum_form.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/stage_iterations.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/system_forcing.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/system/no_constraints.hpp>
#include <pendula/system/options.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {

/// A StageSolver for any system over its generated kernel, in MomentumForm or VelocityForm. It solves by exact Newton;
/// in momentum form also by fixed point, or by whichever takes less. Up to `Width` stages: 2, 4 or 8.
template <int Width = max_stages, class Form = MomentumForm>
class LagrangianSolver : public StageIterations<LagrangianStages<Width, Form>> {
  using Base = StageIterations<LagrangianStages<Width, Form>>;

 public:
  using Model = SystemModel;
  using typename Base::State;
  static constexpr int sequences = 2;  ///< of corrections of its fixed point (FixedPointStop)

  /// Throws std::invalid_argument unless the method has so many stages, at most Width, and keeps constraints that are
  /// there: Gauss methods in momentum form do.
  LagrangianSolver(const Model& model, int stages, Iteration iteration = Iteration::automatic,
                   Family family = Family::gauss)
      : Base(iteration_for(model, iteration, family), newton_cost(model, stages), model, checked(stages), family),
        family_(family),
        newton_(model, stages),
        forcing_(model, family, stages),
        field_(model, stages),
        // Where lengths change, the motion may be singular between the stages, which is never so where all coordinates
        // are angles: energy tells. It is not conserved where something depends on time, nor by velocity form.
        may_miss_(Form::is_symplectic && family != Family::radau && !model.info().depends_on_time &&
                  !std::ranges::all_of(model.info().is_angle, std::identity())) {}

  /// Throws std::invalid_argument on another number of coordinates.
  Status start(const State& state) {
    stages_.model().require(state);
    return stages_.start(state.time, state.q.data(), state.v.data());
  }

  Correction correct() {
    const Correction correction = Base::correct(newton_, coordinates());
    is_complete_ = correction.convergence == Convergence::linear && !stages_.is_constrained();
    return correction;
  }

  int part_of(Status status) {
    if (status == Status::singular_mass_matrix) return stages_.singular_coordinate();
    if (status == Status::wrong_root) return stages_.turning_coordinate();
    return last_.part >= 0 || !Form::has_fixed_point ? last_.part : stages_.most_changing_coordinate();
  }

  double turn() const { return stages_.turn(); }
  StepShape shape() {
    StepShape shape = stages_.shape();
    if (may_miss_) {
      complete();
      shape.imbalance = stages_.imbalance();
    }
    return shape;
  }
  /// What forces do between the stages that were solved.
  Unseen unseen() {
    if (!has_to_look()) return {};
    complete();
    return field_.unseen(stages_);
  }
  double followed(double time, double h, double tolerance) {
    return forcing_.followed(h, tolerance, [&] {
      const double pace = stages_.tempo().pace;
      const auto [q, v] = stages_.here(time);
      return SystemForcing::Here{time, q, v, pace};
    });
  }
  SolverTraits traits() const {
    const SystemModel& model = stages_.model();
    return {
        coordinates(),  coordinates(),  stages_.stages(),        detail::largest_turn_of(model.info().constant_masses),
        model.loaded(), model.damped(), family_ == Family::radau};
  }
  double energy_defect() {
    complete();
    return stages_.energy_defect();
  }

  double accept() {
    complete();
    const double brought = stages_.brought();
    choice_.end_step();
    stages_.accept();
    return brought;
  }

  /// How many coordinates and rates follow from others by constraints.
  int conditions() const { return stages_.conditions(); }
  /// How far the accepted step ended from the constraints, and their rates from 0.
  std::pair<double, double> constraint_errors() const { return stages_.constraint_errors(); }

  /// The derivative of the step that was solved and not yet accepted.
  using Tangent = LagrangianTangent<Width>;
  Tangent make_tangent() const requires Form::is_symplectic { return Tangent(stages_); }
  void linearize(Tangent& tangent) {
    if (stages_.is_constrained()) {
      complete();
      stages_.follow_constraints(true);
    }
    tangent.linearize(stages_);
  }

 private:
  using Base::choice_, Base::last_, Base::stages_;

  int coordinates() const { return static_cast<int>(stages_.count()); }

  static int checked(int stages) {
    if (stages <= Width) return stages;
    throw std::invalid_argument("stages: this solver is compiled for up to " + std::to_string(Width) + ", got " +
                                std::to_string(stages));
  }

  static Iteration iteration_for(const Model& model, Iteration asked, Family family) {
    const auto require = [&](bool keeps, const char* what) {
      if (!keeps) require_no_constraints(model.info(), what);
    };
    require(family == Family::gauss, "method: expected gauss, got radau");
    require(Form::has_fixed_point, "form: expected momentum, got velocity");
    return Form::has_fixed_point ? asked : Iteration::newton;
  }

  // Cost of a Newton iteration in fixed-point iterations, to within a third, as measured on kernels of one to six
  // coordinates (g++ 12, AVX2 and AVX-512).
  static double newton_cost(const Model& model, int stages) {
    const auto unknowns = static_cast<double>(model.coordinates() + model.info().constraints.size());
    return stages * std::min(1.6 + 0.75 * unknowns, 5.5);
  }

  bool has_to_look() const { return !stages_.info().argument_is_base.empty(); }

  // What constraints push at the end of the step. After Newton, what follows from its unknowns is that of those before
  // its last correction.
  void complete() {
    if (is_complete_) return;
    if (last_.convergence == Convergence::quadratic) newton_.follow(stages_);
    if (stages_.is_constrained()) stages_.finish_constraints();
    is_complete_ = true;
  }

  Family family_;
  LagrangianNewton<Width, Form> newton_;
  SystemForcing forcing_;
  LagrangianField<Width, Form> field_;
  bool may_miss_;
  bool is_complete_ = true;
};

}  // namespace pendula
