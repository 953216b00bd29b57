#include "python_events.hpp"

#include <limits>
#include <utility>

#include "arrays.hpp"

namespace pendula::python {
namespace {

double ask(const PythonEvent& event, const Motion& motion) {
  const nb::gil_scoped_acquire lock;
  const nb::object answer = event.function(motion.time, vector_of(state_of(motion)));
  const double value = PyFloat_AsDouble(answer.ptr());
  if (value == -1 && PyErr_Occurred() != nullptr) throw nb::python_error();
  return value;
}

}  // namespace

// The last reference to a function may end where no lock is held.
PythonEvents::PythonEvents(std::vector<PythonEvent> events)
    : events_(new std::vector<PythonEvent>(std::move(events)),
              [](const std::vector<PythonEvent>* held) {
                const nb::gil_scoped_acquire lock;
                delete held;
              }),
      failure_(std::make_shared<std::exception_ptr>()) {}

void PythonEvents::add_to(std::vector<Event>& events) const {
  if (events_ == nullptr) return;
  *failure_ = nullptr;
  for (const PythonEvent& event : *events_) {
    const auto value = [held = events_, failure = failure_, &event](const Motion& motion) {
      if (*failure != nullptr) return std::numeric_limits<double>::quiet_NaN();
      try {
        return ask(event, motion);
      } catch (...) {
        *failure = std::current_exception();
        return std::numeric_limits<double>::quiet_NaN();
      }
    };
    const Direction direction = event.direction > 0   ? Direction::up
                                : event.direction < 0 ? Direction::down
                                                      : Direction::both;
    events.push_back({event.name, value, direction, event.stop});
  }
}

}  // namespace pendula::python
