// What the Python package stands on: runs of scenarios in this process, with rows and events as arrays. All else is
// Python (python/pendula).

#include <Python.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <pendula/pendula.h>

#include <Eigen/Core>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <pendula/pendula.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/run.hpp>
#include <stop_token>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "cli/scenario_subject.hpp"
#include "io/event_reader.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/scenario.hpp"
#include "io/summary.hpp"

namespace nb = nanobind;

namespace pendula::python {
namespace {

using Array = nb::ndarray<nb::numpy, double, nb::ndim<2>>;
using Vector = nb::ndarray<nb::numpy, double, nb::ndim<1>>;
using Tell = nb::typed<nb::callable, void(const std::string&)>;

/// (rows x columns), which Python owns from now on.
Array array_of(std::vector<double> numbers, std::size_t columns) {
  auto kept = std::make_unique<std::vector<double>>(std::move(numbers));
  const std::size_t rows = columns == 0 ? 0 : kept->size() / columns;
  double* const data = kept->data();
  nb::capsule owner(kept.release(), [](void* made) noexcept { delete static_cast<std::vector<double>*>(made); });
  return Array(data, {rows, columns}, owner);
}

/// Keeps rows and events of a run.
class Recorder : public Observer {
 public:
  void take(const Row& row) override { rows.insert(rows.end(), row.numbers.begin(), row.numbers.end()); }
  void happen(const EventRow& happened) override {
    events.push_back(happened.event.name);
    ups.push_back(happened.up ? 1 : 0);
    event_rows.insert(event_rows.end(), happened.row.numbers.begin(), happened.row.numbers.end());
  }

  std::vector<double> rows, event_rows;
  std::vector<std::string> events;
  std::vector<int> ups;
};

/// Asks Python now and then whether Ctrl-C was pressed; the run holds no lock meanwhile.
class Interruption {
 public:
  bool operator()() {
    const auto now = Clock::now();
    if (is_requested_ || now - asked_ < std::chrono::milliseconds(50)) return is_requested_;
    asked_ = now;
    const nb::gil_scoped_acquire lock;
    return is_requested_ = PyErr_CheckSignals() != 0;
  }
  bool is_requested() const { return is_requested_; }

 private:
  using Clock = std::chrono::steady_clock;

  Clock::time_point asked_ = Clock::now();
  bool is_requested_ = false;
};

template <class Space>
void describe(const io::Scenario<Space>& scenario, const std::string& name, io::Summary& summary) {
  summary.model = io::model_summary(name, scenario.chain, scenario.natural);
  summary.final = io::snapshot(scenario.chain, summary.last);
}
void describe(const io::SystemScenario& scenario, const std::string& name, io::Summary& summary) {
  summary.model = io::model_summary(name, *scenario.system);
  summary.system = io::snapshot(*scenario.system, summary.last);
}

/// What came of a run.
struct Result {
  std::vector<std::string> columns, units, roles;
  Recorder recorder;
  std::string summary;  ///< as `pendula simulate --json` prints it
};

const char* name_of(Role role) {
  switch (role) {
    case Role::time:
      return "time";
    case Role::coordinate:
      return "coordinate";
    case Role::rate:
      return "rate";
    case Role::input:
      return "input";
    case Role::point:
      return "point";
    case Role::energy:
      return "energy";
  }
  return "";
}

void name_columns(const Subject& subject, Result& result) {
  result.columns = subject.columns();
  result.units.resize(result.columns.size());
  result.roles.resize(result.columns.size());
  for (const Quantity& quantity : subject.quantities()) {
    for (std::size_t k = 0; k < quantity.size(); ++k) {
      result.units[quantity.column(k)] = quantity.unit;
      result.roles[quantity.column(k)] = name_of(quantity.role);
    }
  }
}

template <class Scenario>
void run(const Scenario& scenario, const std::string& name, const std::string& kernel_by,
         const std::function<bool()>& stop, Result& result) {
  const std::shared_ptr<const Subject> subject = cli::subject_of(scenario);
  const RunSetup setup{.subject = subject,
                       .start = scenario.start,
                       .options = scenario.run,
                       .duration = scenario.duration,
                       .every = scenario.every,
                       .rows = scenario.rows,
                       .accuracy = scenario.accuracy,
                       .estimate = scenario.estimate,
                       .events = io::events_of(scenario.events, subject, scenario.start)};
  name_columns(*subject, result);
  Run run = cli::told_at_keys(scenario, name, [&] { return Run(setup); });
  run.add(result.recorder);
  io::Summary summary;
  std::vector<std::string> warnings = scenario.warnings;
  for (std::string& trouble : run.expected_trouble()) warnings.push_back(std::move(trouble));
  static_cast<RunReport&>(summary) = run.go(stop);
  for (std::string& warning : summary.warnings) warnings.push_back(std::move(warning));
  summary.warnings = std::move(warnings);
  summary.accuracy = setup.accuracy.error;
  summary.duration = setup.duration;
  summary.every = setup.every;
  summary.at = setup.rows;
  for (const Event& event : setup.events) summary.event_names.push_back(event.name);
  summary.ending = io::ending_of(summary, subject->coordinates(), summary.event_names);
  summary.kernel_by = kernel_by;
  describe(scenario, name, summary);
  result.summary = io::to_json(summary);
}

/// Where models are found, and what is told before a kernel is made: by Python, whose lock others have meanwhile.
/// `program` is where the program is in the Python package: it tells where the generator is. `python` runs that.
class Models {
 public:
  Models(const std::string& program, std::string python, const Tell& tell)
      : toolchain_(io::Toolchain::of(program)), tell_(tell) {
    toolchain_.python = std::move(python);
  }

  io::FindSystem finder() {
    return [this](const std::string& model, std::optional<int> links, const std::filesystem::path& folder) {
      const io::ModelKernel kernel = io::find_kernel(model, links, folder, toolchain_, [&](const std::string& what) {
        const nb::gil_scoped_acquire lock;
        tell_(what);
      });
      by_ = kernel.by();
      return kernel.table;
    };
  }
  const std::string& by() const { return by_; }

 private:
  io::Toolchain toolchain_;
  std::string by_ = "build";
  const Tell& tell_;
};

/// Runs a scenario.
std::unique_ptr<Result> simulate(const std::string& text, const std::string& name,
                                 const std::vector<std::string>& overrides, const std::string& program,
                                 const std::string& python, const Tell& tell) {
  auto result = std::make_unique<Result>();
  Interruption interruption;
  {
    const nb::gil_scoped_release others_may_go_on;
    Models models(program, python, tell);
    const io::AnyScenario any = io::parse_scenario(text, name, overrides, models.finder());
    std::visit([&](const auto& scenario) { run(scenario, name, models.by(), std::ref(interruption), *result); }, any);
  }
  if (interruption.is_requested()) throw nb::python_error();
  return result;
}

template <class Space>
Model model_of(const io::Scenario<Space>& scenario) {
  return Model(scenario.chain);
}
Model model_of(const io::SystemScenario& scenario) {
  const PlainSystem numbers = scenario.system->numbers().plain();
  if (!numbers.sines.empty()) throw std::invalid_argument("drives: expected none here, inputs may be held instead");
  std::size_t count = 0;
  for (const auto size : scenario.system->info().parameter_sizes) count += static_cast<std::size_t>(size);
  return Model(pendula_model_of_table(&scenario.system->table(), numbers.parameters, count, numbers.inputs,
                                      scenario.system->info().inputs.size()));
}

/// A system, its start and how it is moved, as a scenario says: what simulations and ensembles begin with.
struct Prepared {
  io::AnyScenario scenario;  // it owns the kernel
  Model model;
  Motion start;
  SimulationOptions options;
};

std::unique_ptr<Prepared> prepare(const std::string& text, const std::string& program, const std::string& python,
                                  const Tell& tell) {
  const nb::gil_scoped_release others_may_go_on;
  Models models(program, python, tell);
  io::AnyScenario any = io::parse_scenario(text, "pendula", {}, models.finder());
  return std::visit(
      [&](const auto& scenario) {
        const RunOptions& run = scenario.run;
        const SimulationOptions options{.method = run.method,
                                        .stages = scenario.places.contains("stages") ? run.stages : 0,
                                        .form = run.form,
                                        .solver = run.solver,
                                        .iteration = run.iteration,
                                        .step = run.step,
                                        .tolerance = run.tolerance};
        Model model = model_of(scenario);
        Motion start = scenario.start;
        return std::unique_ptr<Prepared>(new Prepared{std::move(any), std::move(model), std::move(start), options});
      },
      any);
}

std::vector<double> state_of(const Motion& motion) {
  std::vector<double> state(motion.q.data(), motion.q.data() + motion.q.size());
  state.insert(state.end(), motion.v.data(), motion.v.data() + motion.v.size());
  return state;
}

Vector vector_of(std::vector<double> numbers) {
  auto kept = std::make_unique<std::vector<double>>(std::move(numbers));
  const std::size_t size = kept->size();
  double* const data = kept->data();
  nb::capsule owner(kept.release(), [](void* made) noexcept { delete static_cast<std::vector<double>*>(made); });
  return Vector(data, {size}, owner);
}

Array array_of(const Eigen::MatrixXd& matrix) {
  std::vector<double> numbers;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) numbers.push_back(matrix(i, j));
  }
  auto kept = std::make_unique<std::vector<double>>(std::move(numbers));
  double* const data = kept->data();
  nb::capsule owner(kept.release(), [](void* made) noexcept { delete static_cast<std::vector<double>*>(made); });
  return Array(data, {static_cast<std::size_t>(matrix.rows()), static_cast<std::size_t>(matrix.cols())}, owner);
}

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

/// Asks Python from time to time, while others work, whether Ctrl-C was pressed; then `stop` is requested. Throws what
/// the work does, and what Python has raised.
template <class Do>
void interruptibly(Do act) {
  std::stop_source stop;
  bool is_interrupted = false;
  {
    const nb::gil_scoped_release others_may_go_on;
    auto work = std::async(std::launch::async, [&] { act(stop.get_token()); });
    while (work.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
      const nb::gil_scoped_acquire lock;
      if (is_interrupted || PyErr_CheckSignals() == 0) continue;
      is_interrupted = true;
      stop.request_stop();
    }
    work.get();
  }
  if (is_interrupted) throw nb::python_error();
}

}  // namespace
}  // namespace pendula::python

NB_MODULE(_core, module) {
  using namespace pendula;
  using python::Result;

  module.def("version", &pendula_version);
  module.def("instruction_set", &pendula_instruction_set);
  nb::exception<io::InputError>(module, "InputError", PyExc_ValueError);
  nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
    try {
      std::rethrow_exception(thrown);
    } catch (const io::ModelError& error) {
      PyErr_SetString(nb::module_::import_("pendula._core").attr("InputError").ptr(), error.what());
    }
  });

  nb::class_<Result>(module, "Result")
      .def_ro("columns", &Result::columns)
      .def_ro("units", &Result::units)
      .def_ro("roles", &Result::roles)
      .def_ro("summary", &Result::summary)
      .def_prop_ro("events", [](const Result& result) { return result.recorder.events; })
      .def_prop_ro("ups", [](const Result& result) { return result.recorder.ups; })
      .def("take_rows",
           [](Result& result) { return python::array_of(std::move(result.recorder.rows), result.columns.size()); })
      .def("take_event_rows", [](Result& result) {
        return python::array_of(std::move(result.recorder.event_rows), result.columns.size());
      });
  module.def("simulate", &python::simulate, nb::arg("text"), nb::arg("name"), nb::arg("overrides"), nb::arg("program"),
             nb::arg("python"), nb::arg("tell"));

  using python::Prepared;
  nb::exception<RunFailed>(module, "StepFailed", PyExc_RuntimeError);
  nb::class_<Prepared>(module, "Prepared")
      .def_prop_ro("columns", [](const Prepared& made) { return made.model.columns(); })
      .def_prop_ro("inputs", [](const Prepared& made) { return made.model.input_names(); })
      .def_prop_ro("coordinates", [](const Prepared& made) { return made.model.coordinates(); })
      .def_prop_ro(
          "start", [](const Prepared& made) { return python::vector_of(python::state_of(made.start)); },
          nb::rv_policy::move);
  module.def("prepare", &python::prepare, nb::arg("text"), nb::arg("program"), nb::arg("python"), nb::arg("tell"));

  nb::class_<Simulation>(module, "Simulation")
      .def(
          "__init__",
          [](Simulation* self, const Prepared& made) { new (self) Simulation(made.model, made.start, made.options); },
          nb::keep_alive<1, 2>())
      .def(
          "copy", [](const Simulation& self) { return Simulation(self); }, nb::keep_alive<0, 1>())
      .def_prop_ro("time", &Simulation::time)
      .def_prop_ro("steps", &Simulation::steps)
      .def_prop_ro(
          "state", [](const Simulation& self) { return python::vector_of(python::state_of(self.motion())); },
          nb::rv_policy::move)
      .def("advance_to",
           [](Simulation& self, double time) {
             python::interruptibly([&](const std::stop_token& stop) {
               self.heed(stop);
               self.advance_to(time);
             });
           })
      .def("at", [](Simulation& self, double time) { return python::vector_of(python::state_of(self.at(time))); })
      .def("number", [](const Simulation& self, const std::string& column) { return self[column]; })
      .def("hold", [](Simulation& self, const std::string& input, double value) { self.hold(input, value); })
      .def_prop_ro(
          "held",
          [](const Simulation& self) {
            const Eigen::VectorXd held = self.held();
            return python::vector_of({held.data(), held.data() + held.size()});
          },
          nb::rv_policy::move)
      .def("linearize",
           [](const Simulation& self) {
             const auto [a, b] = self.linearize();
             return std::pair(python::array_of(a), python::array_of(b));
           })
      .def("save", [](const Simulation& self) { return python::vector_of(self.save().numbers); })
      .def("resume", [](Simulation& self, const python::Numbers& saved) {
        self.resume({std::vector<double>(saved.data(), saved.data() + saved.size())});
      });

  module.def("propagate",
             [](const Prepared& made, const python::Starts& starts, double duration,
                int threads) -> nb::typed<nb::tuple, python::Array, python::Array, std::vector<int>, python::Vector> {
               using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
               const Eigen::MatrixXd begins =
                   Eigen::Map<const Rows>(starts.data(), static_cast<Eigen::Index>(starts.shape(0)),
                                          static_cast<Eigen::Index>(starts.shape(1)));
               Ends ends;
               python::interruptibly([&](const std::stop_token& stop) {
                 ends = propagate(made.model, begins,
                                  {.duration = duration, .run = made.options, .threads = threads, .stop = stop});
               });
               std::vector<int> how(ends.how.begin(), ends.how.end());
               const std::vector<double> errors(ends.energy_errors.data(),
                                                ends.energy_errors.data() + ends.energy_errors.size());
               return nb::make_tuple(python::array_of(Eigen::MatrixXd(ends.q)),
                                     python::array_of(Eigen::MatrixXd(ends.v)), how, python::vector_of(errors));
             });

  module.def("lyapunov",
             [](const Prepared& made, double duration,
                int count) -> nb::typed<nb::tuple, python::Vector, python::Vector, double, double, double, double> {
               LyapunovSpectrum found;
               python::interruptibly([&](const std::stop_token& stop) {
                 found = lyapunov(made.model, made.start,
                                  {.duration = duration, .count = count, .run = made.options, .stop = stop});
               });
               const auto numbers = [](const Eigen::VectorXd& x) {
                 return python::vector_of(std::vector<double>(x.data(), x.data() + x.size()));
               };
               return nb::make_tuple(numbers(found.exponents), numbers(found.errors), found.sum, found.duration,
                                     found.ftle, found.megno);
             });
}
