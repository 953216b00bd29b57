#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <pendula/gauss/iteration_choice.hpp>
#include <pendula/gauss/lagrangian_field.hpp>
#include <pendula/gauss/lagrangian_fixed_point.hpp>
#include <pendula/gauss/lagrangian_newton.hpp>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/lagrangian_tangent.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/system_forcing.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/system/options.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {

/// The stage equations of any system in momentum form, q̇ = v, ṗ = ∂L/∂q + Q, p = ∂L/∂v, over its generated kernel:
/// symplectic. Solved by exact Newton, by fixed point, or by whichever takes less. Up to `Width` stages, 4 or 8.
template <System S, int Width = max_stages>
class LagrangianSolver {
 public:
  using Model = SystemModel<S>;
  using Real = double;
  using Vector = typename S::template Vector<double>;
  using State = SystemState<S>;

  /// Throws std::invalid_argument unless the method has so many stages, at most Width.
  LagrangianSolver(const Model& model, int stages, Iteration iteration = Iteration::automatic,
                   Family family = Family::gauss)
      : family_(family),
        stages_(model, checked(stages), family),
        newton_(stages),
        forcing_(family, stages),
        field_(stages),
        choice_(iteration, newton_cost(stages)) {}

  Status start(const State& state) { return stages_.start(state.time, state.q, state.v); }

  void prepare(double time, double h) {
    stages_.prepare(time, h);
    choice_.begin_step();
    count_ = 0;
  }

  void prepare_again(double time, double h) {
    stages_.prepare_again(time, h);
    count_ = 0;
  }

  Correction correct() {
    ++count_;
    choice_.count_iteration();
    forces_are_found_ = choice_.active() == Iteration::fixed_point;
    if (!forces_are_found_) return last_ = newton_.correct(stages_);
    const Correction correction = fixed_point_.correct(stages_);
    if (choice_.is_automatic() &&
        diverges(correction.relative, last_.relative, count_, usual_rounding(parts(), epsilon), epsilon)) {
      if (!choice_.newton_is_allowed()) return last_ = {std::numeric_limits<double>::quiet_NaN(), -1};
      stages_.start_cold();
      choice_.give_up_fixed_point();
      forces_are_found_ = false;
      return last_ = newton_.correct(stages_);
    }
    return last_ = correction;
  }

  void allow_newton(bool allowed) { choice_.allow_newton(allowed); }

  Convergence convergence() const {
    return choice_.active() == Iteration::newton ? Convergence::quadratic : Convergence::linear;
  }

  int worst_part() { return last_.part >= 0 ? last_.part : fixed_point_.worst_coordinate(stages_); }
  int singular_part() const { return stages_.singular_coordinate(); }
  static constexpr bool continues() { return true; }

  // Where inertia may vanish, coordinates may move faster than all else.
  static constexpr double largest_turn() { return S::constant_masses ? 3 : 0.25; }
  // Where lengths change, motion may be singular beside the stages, which angles alone never are. What depends on time
  // keeps no energy.
  static constexpr bool may_miss = !holds_time<S> && !std::ranges::all_of(S::coordinate_is_angle, std::identity());
  double turn() const { return stages_.turn(); }
  int turning_part() const { return stages_.turning_coordinate(); }
  double defect() { return stages_.defect(); }
  double predictor_gain() const { return stages_.predictor_gain(); }
  Tempo tempo() const { return stages_.tempo(); }
  StepShape shape() {
    StepShape shape = stages_.shape();
    if (may_miss && !dissipates()) {
      find_forces();
      shape.imbalance = stages_.imbalance();
    }
    return shape;
  }
  /// Of what forces do between the stages that were solved.
  Unseen unseen() requires tells_arguments<S> {
    find_forces();
    return field_.unseen(stages_);
  }
  bool loaded() const { return stages_.model().loaded(); }
  bool damped() const { return stages_.model().damped(); }
  double followed(double time, double h, double tolerance) {
    return forcing_.followed(stages_.model(), h, tolerance, [&] {
      return std::pair(State{time, stages_.position(), stages_.velocity(time)}, stages_.tempo().pace);
    });
  }
  bool dissipates() const { return family_ == Family::radau; }
  int stages() const { return stages_.stages(); }
  static constexpr int parts() { return S::coordinates; }
  static constexpr int coordinates() { return S::coordinates; }
  double work() const { return stages_.work(); }
  double energy_defect() {
    find_forces();
    return stages_.energy_defect();
  }

  void accept() {
    find_forces();
    choice_.end_step();
    stages_.accept();
  }

  /// The derivative of the step that was solved and not yet accepted.
  using Tangent = LagrangianTangent<S, Width>;
  Tangent make_tangent() const { return Tangent(stages_); }
  void linearize(Tangent& tangent) const { tangent.linearize(stages_); }

  State state(double time) const { return {time, stages_.position_with_turns(), stages_.velocity(time)}; }
  Vector momentum() const { return stages_.momentum(); }
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(stages_, choice_);
  }
  void forget() { stages_.forget(); }
  State glance(double time, double x) const { return stages_.glance(time, x); }
  void remember() { stages_.remember(); }
  void return_to_start() {
    stages_.return_to_start();
    choice_.begin_look();
  }
  void save() { stages_.save(); }
  void restore() { stages_.restore(); }

  Iteration iteration() const { return choice_.preferred(); }

 private:
  static constexpr double epsilon = std::numeric_limits<double>::epsilon();

  static int checked(int stages) {
    if (stages <= Width) return stages;
    throw std::invalid_argument("stages: this solver is compiled for up to " + std::to_string(Width) + ", got " +
                                std::to_string(stages));
  }

  // Of a Newton iteration in fixed-point iterations, as measured on kernels of one to six coordinates (g++ 12, AVX2 and
  // AVX-512): within a third.
  static double newton_cost(int stages) { return stages * std::min(1.6 + 0.75 * S::coordinates, 5.5); }

  // Newton leaves the forces of the rates before its last correction.
  void find_forces() {
    if (!forces_are_found_) newton_.find_forces(stages_);
    forces_are_found_ = true;
  }

  Family family_;
  LagrangianStages<S, Width> stages_;
  LagrangianNewton<S, Width> newton_;
  LagrangianFixedPoint<S, Width> fixed_point_;
  SystemForcing<S> forcing_;
  LagrangianField<S, Width> field_;
  IterationChoice choice_;
  Correction last_;
  int count_ = 0;
  bool forces_are_found_ = true;
};

}  // namespace pendula
