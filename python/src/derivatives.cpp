// Motions and what they depend on, exactly as their steps move them.

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <Eigen/Core>
#include <array>
#include <pendula/run/derivatives.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/run_failed.hpp>
#include <pendula/system/outcome.hpp>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "interruption.hpp"
#include "io/errors.hpp"
#include "io/expression.hpp"
#include "io/row_slopes.hpp"
#include "prepared.hpp"

namespace pendula::python {
namespace {

/// (2 coordinates)
Motion motion_of(const Prepared& made, double time, const Numbers& state) {
  const Eigen::Index count = made.start.q.size();
  if (state.shape(0) != static_cast<std::size_t>(2 * count)) {
    throw std::invalid_argument("state: expected " + std::to_string(2 * count) + " numbers, got " +
                                std::to_string(state.shape(0)));
  }
  const Eigen::Map<const Eigen::VectorXd> numbers(state.data(), 2 * count);
  return {time, numbers.head(count), numbers.tail(count)};
}

Directions<> directions_of(const Starts& from) {
  return Eigen::Map<const Directions<>>(from.data(), static_cast<Eigen::Index>(from.shape(0)),
                                        static_cast<Eigen::Index>(from.shape(1)));
}

/// (times x 2 coordinates). Throws RunFailed.
Array states_of(const Prepared& made, const MovedTo& moved) {
  require(moved.outcome, *made.subject);
  std::vector<double> states;
  for (const Motion& motion : moved.motions) {
    const std::vector<double> state = state_of(motion);
    states.insert(states.end(), state.begin(), state.end());
  }
  return array_of(std::move(states), static_cast<std::size_t>(2 * made.start.q.size()));
}

/// Does what a task asks for, and heeds Ctrl-C.
template <class Do>
auto moved(const Prepared& made, const Motion& start, const Numbers& times, Do act) {
  decltype(act(std::declval<const MotionTask&>())) found;
  interruptibly([&](const std::stop_token& stop) {
    const MotionTask task{.subject = *made.subject,
                          .options = made.options,
                          .start = start,
                          .times = {times.data(), times.shape(0)},
                          .stop = [&] { return stop.stop_requested(); }};
    found = act(task);
  });
  return found;
}

/// States, (times x 2 coordinates), and variations, (times · 2 coordinates x any).
nb::typed<nb::tuple, Array, Array> forward(const Prepared& made, double time, const Numbers& state,
                                           const Numbers& times, const Starts& of_start, const Starts& of_parameters) {
  const Motion start = motion_of(made, time, state);
  const Directions<> by_start = directions_of(of_start), by_parameters = directions_of(of_parameters);
  const Forward found =
      moved(made, start, times, [&](const MotionTask& task) { return move_variations(task, by_start, by_parameters); });
  Array states = states_of(made, found);
  std::vector<double> variations;
  for (const Directions<>& one : found.variations)
    variations.insert(variations.end(), one.data(), one.data() + one.size());
  return nb::make_tuple(states, array_of(std::move(variations), of_start.shape(1)));
}

/// States, and gradients by the start and by parameters.
nb::typed<nb::tuple, Array, Vector, Vector> backward(const Prepared& made, double time, const Numbers& state,
                                                     const Numbers& times, const Starts& gradients) {
  const Motion start = motion_of(made, time, state);
  const Directions<> given = directions_of(gradients);
  const Backward found = moved(made, start, times, [&](const MotionTask& task) { return move_gradients(task, given); });
  return nb::make_tuple(states_of(made, found), vector_of(found.of_start), vector_of(found.of_parameters));
}

/// The gradient of an expression by the time, then by the state, (1 + 2 coordinates).
Vector gradient(const Prepared& made, const std::string& text, double time, const Numbers& state) {
  const io::RowSlopes slopes = io::row_slopes(*made.subject, motion_of(made, time, state), std::array{text});
  if (!slopes.by_inputs.isZero(0)) {
    throw std::invalid_argument("expected an expression in t, coordinates, rates and points, got inputs in " + text);
  }
  Eigen::VectorXd found(1 + slopes.by_state.cols());
  found << slopes.by_time, slopes.by_state.row(0).transpose();
  return vector_of(found);
}

/// What expressions change by beside a state while inputs are held: by the state, and by inputs.
nb::typed<nb::tuple, Array, Array> output_slopes(const Prepared& made, const std::vector<std::string>& expressions,
                                                 double time, const Numbers& state, const std::vector<double>& held) {
  try {
    const io::RowSlopes slopes =
        io::row_slopes(*with_inputs(made.subject, held), motion_of(made, time, state), expressions);
    return nb::make_tuple(array_of(slopes.by_state), array_of(slopes.by_inputs));
  } catch (const io::ExpressionError& error) {
    throw io::InputError("outputs: expected " + error.expected + ", got " + error.got);
  } catch (const std::invalid_argument& error) {
    throw io::InputError(std::string("outputs: ") + error.what());
  }
}

}  // namespace

void define_derivatives(nb::module_& module) {
  module.def("varied_by", [](const Prepared& made) {
    std::vector<std::tuple<std::string, int, bool>> found;
    for (Varied& one : varied_by(*made.subject)) found.emplace_back(std::move(one.name), one.size, one.is_input);
    return found;
  });
  module.def("forward", &forward);
  module.def("backward", &backward);
  module.def("gradient", &gradient);
  module.def("output_slopes", &output_slopes);
  module.def("point_columns", [](const Prepared& made) { return io::point_columns(*made.subject); });
  module.def("field", [](const Prepared& made, double time, const Numbers& state) {
    return vector_of(field_at(*made.subject, motion_of(made, time, state)));
  });
}

}  // namespace pendula::python
