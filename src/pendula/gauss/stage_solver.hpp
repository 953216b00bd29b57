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
};

/// What solves the stage equations of a step: it owns the model, the state and the workspace. Parts are what messages
/// name: the links of a chain, the coordinates of any other system.
template <class S>
concept StageSolver = requires(S solver, const S& fixed, const typename S::State& state, double time, double h,
                               double x, double tolerance) {
  typename S::Model;  // what it is built from, with the number of stages and options of its own
  typename S::Real;   // what it computes in: round-off is that of this type
  { fixed.parts() } -> std::convertible_to<int>;
  { fixed.coordinates() } -> std::convertible_to<int>;
  { fixed.stages() } -> std::convertible_to<int>;
  { fixed.iteration() } -> std::same_as<Iteration>;  // what it iterates by

  // Takes over a state; may find it singular.
  { solver.start(state) } -> std::same_as<Status>;
  { fixed.state(time) } -> std::convertible_to<typename S::State>;
  // Keep a state and go back to it; neither allocates.
  solver.save();
  solver.restore();

  // Remember the state at the start of a step that is about to be accepted; go back there, the stages still known, so
  // that prepare_again may follow. The state in between by the polynomials through them, `time` being that of the start
  // and x in steps from there.
  solver.remember();
  solver.return_to_start();
  { fixed.glance(time, x) } -> std::convertible_to<typename S::State>;

  // Predicts the stages of the next step, cold after `forget`; or those of another step from where one began that was
  // solved and not accepted. Improves them once, moves the state to the end of the step.
  solver.prepare(time, h);
  solver.forget();
  solver.prepare_again(time, h);
  { solver.correct() } -> std::same_as<Correction>;
  solver.allow_newton(true);  // or else a step is not solved where a fixed point does not contract
  { fixed.convergence() } -> std::same_as<Convergence>;  // of its corrections; may change from one to the next
  solver.accept();

  // A part whose coordinates fail at the stages, −1 where none does; where a correction was largest that did not say.
  { fixed.singular_part() } -> std::convertible_to<int>;
  { solver.worst_part() } -> std::convertible_to<int>;

  // The most that a coordinate turns in the step [rad], and beyond what its stage equations have other solutions than
  // the motion; false where the stages cannot be those of the motion.
  { solver.turn() } -> std::convertible_to<double>;
  { fixed.turning_part() } -> std::convertible_to<int>;  // which does, −1 where that is not known
  { fixed.largest_turn() } -> std::convertible_to<double>;
  { fixed.continues() } -> std::convertible_to<bool>;

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
  // Whether energy may come or go, may only go, and whether the method itself takes some.
  { fixed.loaded() } -> std::convertible_to<bool>;
  { fixed.damped() } -> std::convertible_to<bool>;
  { fixed.dissipates() } -> std::convertible_to<bool>;
  // The longest step up to h from here in which stages see what depends on time.
  { solver.followed(time, h, tolerance) } -> std::convertible_to<double>;
};

}  // namespace pendula
