#pragma once

#include <Python.h>
#include <nanobind/nanobind.h>

#include <chrono>
#include <exception>
#include <future>
#include <stop_token>

/// Ctrl-C while C++ works.
namespace pendula::python {

namespace nb = nanobind;

/// Whether this thread is the one that Python's signal handlers run in. Others need not ask, and must not take Python's
/// lock while Python ends.
inline bool hears_signals() {
  const nb::module_ threading = nb::module_::import_("threading");
  return threading.attr("current_thread")().is(threading.attr("main_thread")());
}

/// Throws what a signal handler of Python raises, if one does: Ctrl-C. To be called without Python's lock.
inline void heed_signals() {
  const nb::gil_scoped_acquire lock;
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

/// Asks Python now and then whether Ctrl-C was pressed; the run holds no lock meanwhile.
class Interruption {
 public:
  bool operator()() {
    const auto now = Clock::now();
    if (!hears_ || is_requested_ || now - asked_ < std::chrono::milliseconds(50)) return is_requested_;
    asked_ = now;
    const nb::gil_scoped_acquire lock;
    return is_requested_ = PyErr_CheckSignals() != 0;
  }
  bool is_requested() const { return is_requested_; }

 private:
  using Clock = std::chrono::steady_clock;

  Clock::time_point asked_ = Clock::now();
  bool hears_ = hears_signals(), is_requested_ = false;
};

/// Asks Python from time to time, while others work, whether Ctrl-C was pressed, and calls `tick`; where either raises,
/// `stop` is requested. Throws what the work does, and what Python has raised.
template <class Do, class Tick>
void interruptibly(Do act, Tick tick) {
  std::stop_source stop;
  const bool hears = hears_signals();
  std::exception_ptr raised;
  {
    const nb::gil_scoped_release others_may_go_on;
    auto work = std::async(std::launch::async, [&] { act(stop.get_token()); });
    while (work.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
      if (!hears) continue;
      const nb::gil_scoped_acquire lock;
      if (raised) continue;
      try {
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        tick();
      } catch (const nb::python_error&) {
        raised = std::current_exception();
        stop.request_stop();
      }
    }
    work.get();
  }
  if (raised) std::rethrow_exception(raised);
}
template <class Do>
void interruptibly(Do act) {
  interruptibly(act, [] {});
}

}  // namespace pendula::python
