#pragma once

#include <Eigen/Core>
#include <functional>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <string>
#include <vector>

namespace pendula {

/// Parameters of one name, or one input, that motions are differentiated by.
struct Varied {
  std::string name;
  int size;
  bool is_input;
};

/// What a motion is differentiated by besides its start: parameters, then inputs, the rows of a variation of them. An
/// input is varied by a constant.
std::vector<Varied> varied_by(const Subject& subject);

/// A motion that is differentiated exactly as its steps move it, whose sizes are held.
struct MotionTask {
  const Subject& subject;
  const RunOptions& options;  ///< gauss or radau in momentum form
  const Motion& start;
  std::span<const double> times;  ///< ascending, from the start's on; a step ends at each  [s]
  std::function<bool()> stop = [] { return false; };
};

/// How a motion went on: up to where it failed, or was stopped (interrupted).
struct MovedTo {
  std::vector<Motion> motions;  ///< at the times
  Outcome outcome;
};

/// Variations at the times, each (2 coordinates x any): δq, then δv.
struct Forward : MovedTo {
  std::vector<Directions<>> variations;
};

/// Moves on what the start, (2 coordinates x any), and the parameters, (varied x as many), are varied by. Throws
/// std::invalid_argument for methods that have no derivative, and for wrong sizes.
Forward move_variations(const MotionTask& task, const Directions<>& of_start, const Directions<>& of_parameters);

/// Gradients by the start, (2 coordinates), and by parameters, (varied).
struct Backward : MovedTo {
  Eigen::VectorXd of_start, of_parameters;
};

/// The transpose: moves back what a number depends on the motions at the times by, (2 coordinates x times), to its
/// gradients. Steps are taken once more for it. Throws as move_variations.
Backward move_gradients(const MotionTask& task, const Directions<>& gradients);

/// Throws std::invalid_argument where a link in space is at a pole: nothing is a derivative by phi there.
void require_regular(const Subject& subject, const Motion& motion);

/// dq/dt, dv/dt at a motion, (2 coordinates).
Eigen::VectorXd field_at(const Subject& subject, const Motion& motion);

}  // namespace pendula
