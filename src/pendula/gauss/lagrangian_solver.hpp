#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <pendula/gauss/iteration_choice.hpp>
#include <pendula/gauss/lagrangian_field.hpp>
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
/// symplectic. Solved by exact Newton, by fixed point, or by whichever takes less. Up to `Width` stages: 2, 4 or
/// 8.
template <int Width = max_stages>
class LagrangianSolver {
 public:
  using Model = SystemModel;
  using Real = double;
  using State = Motion;
  static constexpr int sequences = 2;  ///< of corrections of its fixed point (FixedPointStop)

  /// Throws std::invalid_argument unless the method has so many stages, at most Width.
  LagrangianSolver(const Model& model, int stages, Iteration iteration = Iteration::automatic,
                   Family family = Family::gauss)
      : family_(family),
        stages_(model, checked(stages), family),
        newton_(model.coordinates(), stages),
        forcing_(model, family, stages),
        field_(model, stages),
        choice_(iteration, newton_cost(stages)),
        // Where lengths change, motion may be singular beside the stages, which angles alone never are. What depends on
        // time keeps no energy.
        may_miss_(family != Family::radau && !model.info().depends_on_time &&
                  !std::ranges::all_of(model.info().is_angle, std::identity())) {}

  /// Throws std::invalid_argument on another number of coordinates.
  Status start(const State& state) {
    stages_.model().require(state);
    return stages_.start(state.time, state.q.data(), state.v.data());
  }

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
    if (choice_.active() == Iteration::fixed_point) {
      const double change = stages_.iterate();
      if (!gives_up(change)) {
        forces_are_found_ = true;
        last_change_ = change;
        last_part_ = -1;
        return {change, -1};
      }
      if (!choice_.newton_is_allowed()) return {std::numeric_limits<double>::quiet_NaN(), -1};
      stages_.start_cold();
      choice_.give_up_fixed_point();
    }
    forces_are_found_ = false;
    const Correction correction = newton_.correct(stages_);
    last_change_ = correction.relative;
    last_part_ = correction.part;
    return correction;
  }

  void allow_newton(bool allowed) { choice_.allow_newton(allowed); }

  Convergence convergence() const {
    return choice_.active() == Iteration::newton ? Convergence::quadratic : Convergence::linear;
  }

  int worst_part() { return last_part_ >= 0 ? last_part_ : stages_.most_changing_coordinate(); }
  int singular_part() const { return stages_.singular_coordinate(); }
  static constexpr bool continues() { return true; }

  // Where inertia may vanish, coordinates may move faster than all else.
  double largest_turn() const { return stages_.info().constant_masses ? 3 : 0.25; }
  double turn() const { return stages_.turn(); }
  int turning_part() const { return stages_.turning_coordinate(); }
  double defect() { return stages_.defect(); }
  double predictor_gain() const { return stages_.predictor_gain(); }
  Tempo tempo() const { return stages_.tempo(); }
  StepShape shape() {
    StepShape shape = stages_.shape();
    if (may_miss_) {
      find_forces();
      shape.imbalance = stages_.imbalance();
    }
    return shape;
  }
  /// Of what forces do between the stages that were solved.
  Unseen unseen() {
    if (!has_to_look()) return {};
    find_forces();
    return field_.unseen(stages_);
  }
  bool loaded() const { return stages_.model().loaded(); }
  bool damped() const { return stages_.model().damped(); }
  double followed(double time, double h, double tolerance) {
    return forcing_.followed(h, tolerance, [&] {
      const double pace = stages_.tempo().pace;
      const auto [q, v] = stages_.place(time);
      return SystemForcing::Here{time, q, v, pace};
    });
  }
  bool dissipates() const { return family_ == Family::radau; }
  int stages() const { return stages_.stages(); }
  int parts() const { return coordinates(); }
  int coordinates() const { return static_cast<int>(stages_.count()); }
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
  using Tangent = LagrangianTangent<Width>;
  Tangent make_tangent() const { return Tangent(stages_); }
  void linearize(Tangent& tangent) const { tangent.linearize(stages_); }

  State state(double time) const { return stages_.motion(time); }
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
  double newton_cost(int stages) const { return stages * std::min(1.6 + 0.75 * coordinates(), 5.5); }

  bool has_to_look() const { return !stages_.info().argument_is_base.empty(); }

  // Whether a fixed point that changed so much leaves the step to Newton.
  bool gives_up(double change) const {
    return choice_.is_automatic() && diverges(change, last_change_, count_, usual_rounding(parts(), epsilon), epsilon);
  }

  // Newton leaves the forces of the rates before its last correction.
  void find_forces() {
    if (!forces_are_found_) newton_.find_forces(stages_);
    forces_are_found_ = true;
  }

  Family family_;
  LagrangianStages<Width> stages_;
  LagrangianNewton<Width> newton_;
  SystemForcing forcing_;
  LagrangianField<Width> field_;
  IterationChoice choice_;
  bool may_miss_;
  double last_change_ = 0;  // of the last correction, apart from the next: written and read one by one
  int last_part_ = -1;
  int count_ = 0;
  bool forces_are_found_ = true;
};

}  // namespace pendula
