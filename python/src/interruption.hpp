#pragma once

#include <Python.h>
#include <nanobind/nanobind.h>

#include <chrono>
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

/// Asks Python from time to time, while others work, whether Ctrl-C was pressed; then `stop` is requested. Throws what
/// the work does, and what Python has raised.
template <class Do>
void interruptibly(Do act) {
  std::stop_source stop;
  const bool hears = hears_signals();
  bool is_interrupted = false;
  {
    const nb::gil_scoped_release others_may_go_on;
    auto work = std::async(std::launch::async, [&] { act(stop.get_token()); });
    while (work.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
      if (!hears) continue;
      const nb::gil_scoped_acquire lock;
      if (is_interrupted || PyErr_CheckSignals() == 0) continue;
      is_interrupted = true;
      stop.request_stop();
    }
    work.get();
  }
  if (is_interrupted) throw nb::python_error();
}

}  // namespace pendula::python
