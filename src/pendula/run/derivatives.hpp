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

/// The parameters, then the inputs, with respect to which a motion is differentiated: the rows of a variation. An input
/// is varied by a constant.
std::vector<Varied> varied_by(const Subject& subject);

/// A motion to differentiate. Derivatives are those of its discrete steps; step sizes are held fixed.
struct MotionTask {
  const Subject& subject;
  const RunOptions& options;  ///< gauss or radau in momentum form
  const Motion& start;
  std::span<const double> times;  ///< ascending, none before the start; a step ends at each  [s]
  std::function<bool()> stop = [] { return false; };
};

/// The result of a motion, up to where it failed or was stopped (Status::interrupted).
struct MovedTo {
  std::vector<Motion> motions;  ///< at the times
  Outcome outcome;
};

/// Variations at the times, each (2 coordinates x any): δq, then δv.
struct Forward : MovedTo {
  std::vector<Directions<>> variations;
};

/// Propagates variations of the start, (2 coordinates x any), and of the parameters, (varied x as many), to the times.
/// Throws std::invalid_argument for methods that have no derivative, and for wrong sizes.
Forward move_variations(const MotionTask& task, const Directions<>& of_start, const Directions<>& of_parameters);

/// Gradients with respect to the start, (2 coordinates), and to parameters, (varied).
struct Backward : MovedTo {
  Eigen::VectorXd of_start, of_parameters;
};

/// The transpose of move_variations. `gradients`, (2 coordinates x times), are those of a number with respect to the
/// motions at the times. Returns those with respect to the start and the parameters. Takes the steps twice. Throws as
/// move_variations.
Backward move_gradients(const MotionTask& task, const Directions<>& gradients);

/// Throws std::invalid_argument where a link in space is at a pole: no derivative with respect to phi exists there.
void require_regular(const Subject& subject, const Motion& motion);

/// dq/dt, dv/dt at a motion, (2 coordinates).
Eigen::VectorXd field_at(const Subject& subject, const Motion& motion);

}  // namespace pendula
