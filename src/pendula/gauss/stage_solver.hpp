#pragma once

#include <concepts>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>

namespace pendula {

/// What one iteration on the stages did.
struct Correction {
  double relative = 0;  ///< largest change of an unknown, relative to the size of the unknowns
  int part = -1;        ///< 0-based link or coordinate where it happened; −1: ask the solver
  Convergence convergence = Convergence::linear;
};

/// What a solver is that stays as it is. Parts are what messages name: the links of a chain, the coordinates of any
/// other system.
struct SolverTraits {
  int parts, coordinates, stages;
  double largest_turn;  ///< beyond it stage equations have other solutions than the motion  [rad]
  bool loaded, damped;  ///< whether energy may come or go, and whether it may only go
  bool dissipates;      ///< whether the method itself takes some
};

/// What solves the stage equations of a step: it owns the model, the state and the workspace.
template <class S>
concept StageSolver = requires(S solver, const S& fixed, const typename S::State& state, typename S::Place& place,
                               const typename S::Place& kept, double time, double h, double x, double tolerance,
                               Status status) {
  typename S::Model;  // what it is built from, with the number of stages and options of its own
  typename S::Real;   // what it computes in: round-off is that of this type
  { fixed.traits() } -> std::same_as<SolverTraits>;
  { fixed.iteration() } -> std::same_as<Iteration>;  // what it iterates by

  // Takes over a state; may find it singular.
  { solver.start(state) } -> std::same_as<Status>;
  { fixed.state(time) } -> std::convertible_to<typename S::State>;
  // The state as a value, and back to it, the stages still known: prepare_again may follow. To keep it in a place that
  // there is does not allocate.
  { fixed.place() } -> std::same_as<typename S::Place>;
  fixed.keep(place);
  solver.go_to(kept);
  // Between a place where the last step began and its end, by the polynomials through the stages; x in steps from
  // there.
  { fixed.glance(kept, time, x) } -> std::convertible_to<typename S::State>;

  // Predicts the stages of the next step, cold after `forget`; or those of another step from where one began that was
  // solved and not accepted. Improves them once, moves the state to the end of the step.
  solver.prepare(time, h);
  solver.forget();
  solver.prepare_again(time, h);
  { solver.correct() } -> std::same_as<Correction>;
  solver.allow_newton(true);  // or else a step is not solved where a fixed point does not contract
  solver.accept();

  // The part that fails with such a status: whose coordinates are singular at the stages, which turns too far, where
  // the last correction was largest; −1 where there is none, or nobody knows.
  { solver.part_of(status) } -> std::convertible_to<int>;

  // The most that a coordinate turns in the step [rad]; infinity where the stages cannot be those of the motion.
  { solver.turn() } -> std::convertible_to<double>;
  // Energy of the end of the step against its start and the work of loads, relative to all that there is; that work
  // [J].
  { solver.energy_defect() } -> std::convertible_to<double>;
  { solver.work() } -> std::convertible_to<double>;
  // How far, at the start of the step, the polynomial through its stage velocities is off, relative to the fastest so
  // far; how much larger the error of a prediction is than such a defect.
  { solver.defect() } -> std::convertible_to<double>;
  { fixed.predictor_gain() } -> std::convertible_to<double>;
  // Of the state; what the stages show of the step.
  { fixed.tempo() } -> std::same_as<Tempo>;
  { solver.shape() } -> std::same_as<StepShape>;
  // The longest step up to h from here in which stages see what depends on time.
  { solver.followed(time, h, tolerance) } -> std::convertible_to<double>;
};

}  // namespace pendula
