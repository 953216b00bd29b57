// Simulations, step by step, and what is known of motions nearby.

#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <functional>
#include <memory>
#include <pendula/ensemble/held_members.hpp>
#include <pendula/run/linearize.hpp>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/mover.hpp>
#include <pendula/run/run_failed.hpp>
#include <pendula/system/outcome.hpp>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "interruption.hpp"
#include "prepared.hpp"

namespace pendula::python {
namespace {

/// Motions of one system side by side.
struct Held {
  std::shared_ptr<const Prepared> made;
  HeldMembers members;
};

/// While it lives, an interruption stops the mover.
class Heeding {
 public:
  Heeding(Mover& mover, Interruption& interruption) : mover_(mover) { mover_.set_stop(std::ref(interruption)); }
  Heeding(const Heeding&) = delete;
  Heeding& operator=(const Heeding&) = delete;
  ~Heeding() {
    mover_.set_stop([] { return false; });
  }

 private:
  Mover& mover_;
};

}  // namespace

void define_simulations(nb::module_& module) {
  nb::exception<RunFailed>(module, "StepFailed", PyExc_RuntimeError);  // NOLINT(bugprone-unused-raii)
  nb::class_<Mover>(module, "Simulation")
      .def(nb::new_([](const Prepared& made, bool remembers) {
        auto mover = std::make_unique<Mover>(made.subject, made.options, remembers);
        require(mover->start(made.start), *made.subject);
        return mover;
      }))
      .def("copy", [](const Mover& self) { return std::make_unique<Mover>(self); })
      .def_prop_ro("time", [](const Mover& self) { return self.motion().time; })
      .def_prop_ro("steps", &Mover::steps)
      .def_prop_ro(
          "state", [](const Mover& self) { return vector_of(state_of(self.motion())); }, nb::rv_policy::move)
      .def("advance_to",
           [](Mover& self, double time) {
             Interruption interruption;
             {
               const nb::gil_scoped_release others_may_go_on;
               const Heeding heeding(self, interruption);
               require(self.advance_to(time).outcome, self.subject());
             }
             if (interruption.is_requested()) throw nb::python_error();
           })
      .def("at",
           [](Mover& self, double time) {
             Motion motion;
             require(self.at(time, motion), self.subject());
             return vector_of(state_of(motion));
           })
      .def("row",
           [](const Mover& self) {
             std::vector<double> row;
             self.subject().append_row(self.motion(), self.subject().observe(self.motion()), row);
             return vector_of(std::move(row));
           })
      .def("hold", [](Mover& self, const std::vector<double>& inputs) { require(self.hold(inputs), self.subject()); })
      .def_prop_ro("held", &Mover::inputs)
      .def("linearize",
           [](const Mover& self) {
             const Linearized found = linearize(self.subject(), self.motion());
             return std::pair(array_of(found.a), array_of(found.b));
           })
      .def("independent",
           [](const Mover& self) {
             const Independent found = find_independent(self.subject(), self.motion());
             return std::pair(found.places, array_of(found.basis));
           })
      .def("save", [](Mover& self) { return vector_of(self.save().numbers); })
      .def("resume", [](Mover& self, const Numbers& saved) {
        self.resume({std::vector<double>(saved.data(), saved.data() + saved.size())});
      });
  nb::class_<Held>(module, "HeldMembers")
      .def("__init__",
           [](Held* self, const std::shared_ptr<const Prepared>& made, double duration) {
             new (self) Held{made, HeldMembers(made->subject, static_cast<std::size_t>(made->start.q.size()),
                                               made->options, duration)};
           })
      .def("move", [](Held& self, const Starts& inputs, const Starts& states) {
        std::vector<double> moved(states.data(), states.data() + states.size());
        HeldMembers::MoveResult found;
        Interruption interruption;
        {
          const nb::gil_scoped_release others_may_go_on;
          found = self.members.move({inputs.data(), inputs.size()}, moved, std::ref(interruption));
        }
        if (interruption.is_requested()) throw nb::python_error();
        if (!found.outcome) {
          throw RunFailed("member " + std::to_string(found.member) + ": " +
                          message(found.outcome, self.made->subject->coordinates()));
        }
        return array_of(std::move(moved), states.shape(1));
      });
  module.def("lyapunov",
             [](const Prepared& made, double duration,
                int count) -> nb::typed<nb::tuple, Vector, Vector, double, double, double, double> {
               LyapunovRun found;
               interruptibly([&](const std::stop_token& stop) {
                 const std::unique_ptr<Integrator> integrator = made.subject->make_integrator(made.options);
                 found = find_lyapunov_spectrum(
                     *integrator, made.start, longest_step(made.options), duration, count,
                     [](const LyapunovProgress&) {}, [&] { return stop.stop_requested(); });
               });
               require(found.result.outcome, *made.subject);
               return nb::make_tuple(vector_of(found.exponents), vector_of(found.errors), found.sum, found.duration,
                                     found.ftle, found.megno);
             });
}

}  // namespace pendula::python
