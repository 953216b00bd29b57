#pragma once

#include <Python.h>
#include <nanobind/nanobind.h>

#include <exception>
#include <memory>
#include <pendula/run/event.hpp>
#include <string>
#include <vector>

/// Events that are functions of Python.
namespace pendula::python {

namespace nb = nanobind;

/// One of them, as Python gives it.
struct PythonEvent {
  std::string name;
  nb::callable function;  ///< of the time and the state
  int direction = 0;      ///< as SciPy's: up 1, down −1, both 0
  bool stop = false;
};

/// They can be asked while others hold Python's lock; the first exception in one ends the run.
class PythonEvents {
 public:
  PythonEvents() = default;
  explicit PythonEvents(std::vector<PythonEvent> events);

  /// Adds them to those that a run looks for.
  void add_to(std::vector<Event>& events) const;
  /// Whether one has raised an exception, and throws it again.
  bool has_failed() const { return failure_ != nullptr && *failure_ != nullptr; }
  void rethrow() const {
    if (has_failed()) std::rethrow_exception(*failure_);
  }

 private:
  std::shared_ptr<const std::vector<PythonEvent>> events_;
  std::shared_ptr<std::exception_ptr> failure_;
};

}  // namespace pendula::python
