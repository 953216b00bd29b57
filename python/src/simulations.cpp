// Simulations, step by step, and what is known of motions nearby.

#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <pendula/pendula.h>

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <memory>
#include <pendula/ensemble/held_members.hpp>
#include <pendula/pendula.hpp>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <pendula/system/outcome.hpp>
#include <stdexcept>
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

/// A simulation, and what it needs; copies share that.
struct SharedSimulation {
  std::shared_ptr<const Prepared> made;
  Simulation simulation;
};

/// Motions of one system side by side.
struct Held {
  std::shared_ptr<const Prepared> made;
  HeldMembers members;
};

/// While it lives, an interruption stops the simulation.
class Heeding {
 public:
  Heeding(Simulation& simulation, Interruption& interruption) : simulation_(simulation) {
    const auto ask = [](void* context) { return (*static_cast<Interruption*>(context))() ? 1 : 0; };
    heed(ask, &interruption);
  }
  Heeding(const Heeding&) = delete;
  Heeding& operator=(const Heeding&) = delete;
  ~Heeding() { heed(nullptr, nullptr); }

 private:
  void heed(int (*ask)(void*), void* context) { pendula_heed(simulation_.get(), ask, context); }

  Simulation& simulation_;
};

}  // namespace

void define_simulations(nb::module_& module) {
  nb::exception<RunFailed>(module, "StepFailed", PyExc_RuntimeError);  // NOLINT(bugprone-unused-raii)
  nb::class_<SharedSimulation>(module, "Simulation")
      .def("__init__",
           [](SharedSimulation* self, const std::shared_ptr<const Prepared>& made) {
             if (made->subject->part_at(0)) throw std::invalid_argument(signals_are_not_here);
             new (self) SharedSimulation{made, Simulation(model_of(*made), made->start, made->options)};
           })
      .def("copy", [](const SharedSimulation& self) { return SharedSimulation(self); })
      .def_prop_ro("time", [](const SharedSimulation& self) { return self.simulation.time(); })
      .def_prop_ro("steps", [](const SharedSimulation& self) { return self.simulation.steps(); })
      .def_prop_ro(
          "state", [](const SharedSimulation& self) { return vector_of(state_of(self.simulation.motion())); },
          nb::rv_policy::move)
      .def("advance_to",
           [](SharedSimulation& self, double time) {
             Interruption interruption;
             {
               const nb::gil_scoped_release others_may_go_on;
               const Heeding heeding(self.simulation, interruption);
               self.simulation.advance_to(time);
             }
             if (interruption.is_requested()) throw nb::python_error();
           })
      .def("at", [](SharedSimulation& self, double time) { return vector_of(state_of(self.simulation.at(time))); })
      .def("number", [](const SharedSimulation& self, const std::string& column) { return self.simulation[column]; })
      .def("hold",
           [](SharedSimulation& self, const std::vector<double>& inputs) {
             self.simulation.hold(
                 Eigen::Map<const Eigen::VectorXd>(inputs.data(), static_cast<Eigen::Index>(inputs.size())));
           })
      .def_prop_ro("held",
                   [](const SharedSimulation& self) {
                     const Eigen::VectorXd held = self.simulation.held();
                     return std::vector<double>(held.data(), held.data() + held.size());
                   })
      .def("linearize",
           [](const SharedSimulation& self) {
             const auto [a, b] = self.simulation.linearize();
             return std::pair(array_of(a), array_of(b));
           })
      .def("save", [](const SharedSimulation& self) { return vector_of(self.simulation.save().numbers); })
      .def("resume", [](SharedSimulation& self, const Numbers& saved) {
        self.simulation.resume({std::vector<double>(saved.data(), saved.data() + saved.size())});
      });
  nb::class_<Held>(module, "HeldMembers")
      .def("__init__",
           [](Held* self, const std::shared_ptr<const Prepared>& made, double duration) {
             new (self) Held{
                 made, HeldMembers(made->subject, static_cast<std::size_t>(made->start.q.size()), made->run, duration)};
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
                 const std::unique_ptr<Integrator> integrator = made.subject->make_integrator(made.run);
                 const double step = is_adaptive(made.run) ? std::numeric_limits<double>::infinity() : made.run.step;
                 found = find_lyapunov_spectrum(
                     *integrator, made.start, step, duration, count, [](const LyapunovProgress&) {},
                     [&] { return stop.stop_requested(); });
               });
               if (!found.result.outcome) throw RunFailed(message(found.result.outcome, made.subject->coordinates()));
               return nb::make_tuple(vector_of(found.exponents), vector_of(found.errors), found.sum, found.duration,
                                     found.ftle, found.megno);
             });
}

}  // namespace pendula::python
