#pragma once

#include <concepts>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/system/member.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>

namespace pendula {

/// What one iteration on the stages did.
struct Correction {
  double relative = 0;  ///< largest change of an unknown, relative to the size of the unknowns
  int part = -1;        ///< 0-based link or coordinate where it happened; −1: ask the solver
  Convergence convergence = Convergence::linear;
};

/// What does not change while a solver is used. Parts are what messages name: the links of a chain, the coordinates of
/// any other system.
struct SolverTraits {
  int parts, coordinates, stages;
  double largest_turn;  ///< in one step; beyond it the stage equations may have solutions that are no motion  [rad]
  bool loaded, damped;  ///< whether loads bring or take energy, and whether they may only take it
  bool dissipates;      ///< whether the method itself takes some
};

/// What solves the stage equations of a step: it owns the model, the state and the stages. GaussStepper takes steps
/// with any such solver. A solver may have, too:
///   unseen()             what forces do between the stages that were solved (Unseen);
///   set_stop_sign(stop)  a sign that it looks at within long iterations (StopSign);
///   linearize(…)         the derivative of the step (LinearizingSolver).
template <class S>
concept StageSolver = requires(S solver, const S& fixed, const typename S::State& state, typename S::FullState& place,
                               const typename S::FullState& kept, const StepTask& task, MemberNumbers& numbers,
                               double time, double h, double x, double tolerance, double noticed, double* each,
                               Status status) {
  typename S::Model;  // what it is built from, with the number of stages and options of its own
  typename S::Real;   // the number type that it computes in, and that round-off is measured in
  requires std::default_initializable<typename S::FullState>;

  { fixed.traits() } -> std::same_as<SolverTraits>;
  { fixed.iteration() } -> std::same_as<Iteration>;  // that it prefers by now

  // --- The state ---

  // Starts at a state, unless the mass matrix is singular there; returns the state, in the user's coordinates.
  { solver.start(state) } -> std::same_as<Status>;
  { fixed.state(time) } -> std::convertible_to<typename S::State>;
  // Copies the state, and goes back to a copy; the stages stay as they are. Only the first copy to an object allocates.
  fixed.keep(place);
  solver.go_to(kept);
  // The state within the last step, by the polynomials through its stages: x steps after the place where it began.
  { fixed.at(kept, time, x) } -> std::convertible_to<typename S::State>;
  // Bounds of how far each coordinate and its rate get, anywhere in the last step, from where they were when it began;
  // whether they are known.
  { fixed.bound_excursions(kept, each, each) } -> std::same_as<bool>;
  // All numbers that the next steps depend on.
  solver.member(numbers);

  // --- A step ---

  // Predicts the stages, improves them by one iteration, and moves the state to the end of the step; the last gives the
  // energy that loads brought in it  [J].
  solver.prepare(task);
  { solver.correct() } -> std::same_as<Correction>;
  { solver.accept() } -> std::convertible_to<double>;

  // --- What the stages show, once they are solved ---

  // The most that a coordinate turns in the step  [rad]; infinity where the stages cannot be those of the motion.
  { solver.turn() } -> std::convertible_to<double>;
  // Energy at the end of the step, less that of its start and the work of loads, relative to all that there is.
  { solver.energy_defect() } -> std::convertible_to<double>;
  // How far the polynomial through the stages' rates misses the rates at the start of the step, relative to the fastest
  // so far; 0 where the first correction of the step shows that it is less than `noticed`.
  { solver.defect(noticed) } -> std::convertible_to<double>;
  // What the error of the step follows from.
  { solver.shape() } -> std::same_as<StepShape>;
  // The part that a failure of this kind points at: the one whose coordinates are singular, the one that turns most, or
  // the one that the last iteration changed most; −1 where there is none, or nobody knows.
  { solver.part_of(status) } -> std::convertible_to<int>;

  // --- How long the next step may be ---

  // How fast the motion goes on from the state.
  { fixed.tempo() } -> std::same_as<Tempo>;
  // The longest step up to h in which the stages see, to a tolerance, all that depends on time.
  { solver.followed(time, h, tolerance) } -> std::convertible_to<double>;
};

}  // namespace pendula
