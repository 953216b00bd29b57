#include <pendula/run/derivatives.hpp>

#include <pendula/pendula.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <memory>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/run_failed.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <stdexcept>

#include "front/errors.hpp"
#include "front/model.hpp"
#include "front/options.hpp"

namespace pendula::front {
namespace {

using Given = Eigen::Map<const Directions<>>;

Eigen::Index index(std::size_t size) {
  return static_cast<Eigen::Index>(size);
}

/// The subject, options and start of a path, which a MotionTask refers to.
struct Journey {
  explicit Journey(const pendula_path& path)
      : subject(holding(*path.model, path.inputs)),
        options(options_of(path.options)),
        start(motion_of(*path.model, path.time, path.q, path.v)),
        state(2 * start.q.size()),
        varied(index(path.model->parameters.size() + path.model->inputs.size())),
        times(index(path.time_count)) {
    if (path.times == nullptr || path.time_count == 0)
      throw std::invalid_argument("times: expected one or more, got none");
  }

  std::shared_ptr<const Subject> subject;
  RunOptions options;
  Motion start;
  Eigen::Index state, varied, times;  // sizes: of a state; of parameters and inputs; number of rows
};

/// Moves by `act`, a function of a MotionTask. Throws RunFailed.
template <class Act>
auto moved_along(const pendula_path& path, const Journey& journey, Act act) {
  MotionTask task{.subject = *journey.subject,
                  .options = journey.options,
                  .start = journey.start,
                  .times = {path.times, path.time_count}};
  if (path.stop != nullptr) task.stop = [&path] { return path.stop(path.context) != 0; };
  auto found = act(task);
  if (found.outcome.status != Status::interrupted) require(found.outcome, *journey.subject);
  return found;
}

void write_states(const MovedTo& moved, double* states) {
  if (states == nullptr) return;
  for (const Motion& motion : moved.motions) {
    states = std::ranges::copy(motion.q, states).out;
    states = std::ranges::copy(motion.v, states).out;
  }
}

}  // namespace

extern "C" {

pendula_status pendula_field(const pendula_model* model, double time, const double* q, const double* v,
                             const double* inputs, double* field) {
  return guarded([&] {
    std::ranges::copy(field_at(*holding(*model, inputs), motion_of(*model, time, q, v)), field);
    return PENDULA_OK;
  });
}

pendula_status pendula_push(const pendula_path* path, const double* of_start, const double* of_parameters, size_t count,
                            double* states, double* changes) {
  return guarded([&] {
    const Journey journey(*path);
    const Eigen::Index columns = index(count);
    Directions<> by_start = Directions<>::Zero(journey.state, columns);
    Directions<> by_varied = Directions<>::Zero(journey.varied, columns);
    if (of_start != nullptr) by_start = Given(of_start, journey.state, columns);
    if (of_parameters != nullptr) by_varied = Given(of_parameters, journey.varied, columns);
    const Forward moved =
        moved_along(*path, journey, [&](const MotionTask& task) { return move_variations(task, by_start, by_varied); });
    if (!moved.outcome) return PENDULA_STOPPED;
    write_states(moved, states);
    if (changes == nullptr) return PENDULA_OK;
    for (const Directions<>& one : moved.variations) changes = std::copy_n(one.data(), one.size(), changes);
    return PENDULA_OK;
  });
}

pendula_status pendula_pull(const pendula_path* path, const double* gradients, double* states, double* by_start,
                            double* by_parameters) {
  return guarded([&] {
    const Journey journey(*path);
    if (gradients == nullptr) throw std::invalid_argument("gradients: expected one of each state, got none");
    const Directions<> given = Given(gradients, journey.times, journey.state).transpose();
    const Backward moved =
        moved_along(*path, journey, [&](const MotionTask& task) { return move_gradients(task, given); });
    if (!moved.outcome) return PENDULA_STOPPED;
    write_states(moved, states);
    if (by_start != nullptr) std::ranges::copy(moved.of_start, by_start);
    if (by_parameters != nullptr) std::ranges::copy(moved.of_parameters, by_parameters);
    return PENDULA_OK;
  });
}
}

}  // namespace pendula::front
