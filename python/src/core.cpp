// What the Python package stands on: runs of scenarios in this process, with rows and events as arrays. All else is
// Python (python/pendula).

#include <Python.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <pendula/pendula.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <future>
#include <initializer_list>
#include <memory>
#include <optional>
#include <pendula/ensemble/propagate.hpp>
#include <pendula/pendula.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "io/event_reader.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/scenario.hpp"
#include "io/scenario_run.hpp"
#include "io/summary.hpp"

namespace nb = nanobind;

namespace pendula::python {
namespace {

using Array = nb::ndarray<nb::numpy, double, nb::ndim<2>>;
using Vector = nb::ndarray<nb::numpy, double, nb::ndim<1>>;
using Tell = nb::typed<nb::callable, void(const std::string&)>;

/// An array of numbers, which Python owns from now on.
template <class ArrayType>
ArrayType owned(std::vector<double> numbers, std::initializer_list<std::size_t> shape) {
  auto kept = std::make_unique<std::vector<double>>(std::move(numbers));
  double* const data = kept->data();
  nb::capsule owner(kept.release(), [](void* made) noexcept { delete static_cast<std::vector<double>*>(made); });
  return ArrayType(data, shape, owner);
}
Vector vector_of(std::vector<double> numbers) {
  const std::size_t size = numbers.size();
  return owned<Vector>(std::move(numbers), {size});
}
Vector vector_of(const Eigen::VectorXd& numbers) {
  return vector_of(std::vector<double>(numbers.data(), numbers.data() + numbers.size()));
}
/// (rows x columns)
Array array_of(std::vector<double> numbers, std::size_t columns) {
  const std::size_t rows = columns == 0 ? 0 : numbers.size() / columns;
  return owned<Array>(std::move(numbers), {rows, columns});
}
Array array_of(const Eigen::MatrixXd& matrix) {
  const auto rows = static_cast<std::size_t>(matrix.rows()), columns = static_cast<std::size_t>(matrix.cols());
  std::vector<double> numbers(rows * columns);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<RowMajor>(numbers.data(), matrix.rows(), matrix.cols()) = matrix;
  return owned<Array>(std::move(numbers), {rows, columns});
}

/// Keeps rows and events of a run.
class Recorder : public Observer {
 public:
  void take(const Row& row) override { rows.insert(rows.end(), row.numbers.begin(), row.numbers.end()); }
  void happen(const EventRow& happened) override {
    events.push_back(happened.event.name);
    event_rows.insert(event_rows.end(), happened.row.numbers.begin(), happened.row.numbers.end());
  }

  std::vector<double> rows, event_rows;
  std::vector<std::string> events;  ///< names, one for each of event_rows
};

/// Whether this thread is the one that Python's signal handlers run in. Others need not ask, and must not take Python's
/// lock while Python ends.
bool hears_signals() {
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

/// What came of a run.
struct Result {
  std::vector<std::string> columns, units;
  std::vector<std::size_t> state;  ///< columns of the coordinates, then of their rates
  Recorder recorder;
  std::string summary;  ///< as `pendula simulate --json` prints it
};

/// Columns of the numbers of a role in the order of a motion: of a chain all theta, then all phi; of another system as
/// its columns come.
std::vector<std::size_t> columns_of(const Subject& subject, Role role) {
  std::vector<std::size_t> columns;
  for (const Quantity& quantity : subject.quantities()) {
    if (quantity.role != role) continue;
    for (std::size_t k = 0; k < quantity.size(); ++k) columns.push_back(quantity.column(k));
  }
  if (dynamic_cast<const SystemSubject*>(&subject) != nullptr) std::ranges::sort(columns);
  return columns;
}

std::vector<std::size_t> state_columns(const Subject& subject) {
  std::vector<std::size_t> columns = columns_of(subject, Role::coordinate);
  for (const std::size_t column : columns_of(subject, Role::rate)) columns.push_back(column);
  return columns;
}

void name_columns(const Subject& subject, const std::optional<io::NaturalUnits>& natural, Result& result) {
  result.columns = subject.columns();
  result.state = state_columns(subject);
  result.units.resize(result.columns.size());
  for (const Quantity& quantity : subject.quantities()) {
    const std::string unit = io::in_units(natural, quantity.unit);
    for (std::size_t k = 0; k < quantity.size(); ++k) result.units[quantity.column(k)] = unit;
  }
}

template <class Scenario>
void run(const Scenario& scenario, const std::string& name, const std::string& kernel_by,
         const std::function<bool()>& stop, Result& result) {
  const RunSetup setup = io::setup_of(scenario);
  name_columns(*setup.subject, scenario.natural, result);
  Run run = io::told_at_keys(scenario, name, [&] { return Run(setup); });
  run.add(result.recorder);
  io::Summary summary;
  std::vector<std::string> warnings = scenario.warnings;
  for (std::string& trouble : run.expected_trouble()) warnings.push_back(std::move(trouble));
  static_cast<RunReport&>(summary) = run.go(stop);
  for (std::string& warning : summary.warnings) warnings.push_back(std::move(warning));
  summary.warnings = std::move(warnings);
  io::describe(setup, summary);
  summary.kernel_by = kernel_by;
  io::describe(scenario, name, summary);
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
  std::shared_ptr<const Subject> subject;
  Motion start;
  SimulationOptions options;
  RunOptions run;
  std::vector<std::string> warnings;
};

/// The same as a model of the front, which has no drives of systems.
Model model_of(const Prepared& made) {
  return std::visit([](const auto& scenario) { return model_of(scenario); }, made.scenario);
}

/// A simulation, and what it needs; copies share that.
struct Moved {
  std::shared_ptr<const Prepared> made;
  Simulation simulation;
};

std::shared_ptr<Prepared> prepare(const std::string& text, const std::string& program, const std::string& python,
                                  const Tell& tell, bool remembers) {
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
                                        .tolerance = run.tolerance,
                                        .remember = remembers};
        std::shared_ptr<const Subject> subject = io::subject_of(scenario);
        Motion start = scenario.start;
        std::vector<std::string> warnings = scenario.warnings;
        return std::shared_ptr<Prepared>(
            new Prepared{std::move(any), std::move(subject), std::move(start), options, run, std::move(warnings)});
      },
      any);
}

std::vector<double> state_of(const Motion& motion) {
  std::vector<double> state(motion.q.data(), motion.q.data() + motion.q.size());
  state.insert(state.end(), motion.v.data(), motion.v.data() + motion.v.size());
  return state;
}

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

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

/// What became of the members of an ensemble: ends (members x state), how (RunEnd), energy errors, and why not to trust
/// a member ("" where nothing speaks against it).
using Propagated = nb::typed<nb::tuple, Array, std::vector<int>, Vector, std::vector<std::string>>;

Propagated propagate_all(const Prepared& made, const Starts& starts, double duration, int threads, bool estimate) {
  const std::size_t members = starts.shape(0), size = starts.shape(1);
  const auto coordinates = static_cast<Eigen::Index>(size / 2);
  std::vector<EnsembleMember> all;
  for (std::size_t k = 0; k < members; ++k) {
    const Eigen::Map<const Eigen::VectorXd> row(starts.data() + k * size, static_cast<Eigen::Index>(size));
    all.push_back({made.subject, Motion(0, row.head(coordinates), row.tail(coordinates))});
  }
  std::vector<double> ends(starts.data(), starts.data() + members * size), errors(members);
  std::vector<int> how(members);
  std::vector<std::string> doubts(members);
  interruptibly([&](const std::stop_token& stop) {
    EnsembleSchedule schedule;
    schedule.options = made.run;
    schedule.duration = duration;
    schedule.estimate = estimate;
    schedule.threads = threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    schedule.stop = [&] { return stop.stop_requested(); };
    propagate(all, schedule, [&](std::size_t k, const RunReport& report) {
      how[k] = static_cast<int>(report.end);
      errors[k] = report.energy_error.largest;
      if (!report.warnings.empty()) doubts[k] = report.warnings.front();
      if (report.last.q.size() == 0) return;
      std::ranges::copy(state_of(report.last), ends.begin() + static_cast<std::ptrdiff_t>(k * size));
    });
  });
  return nb::make_tuple(array_of(std::move(ends), size), how, vector_of(std::move(errors)), doubts);
}

void define(nb::module_& module) {
  nb::set_leak_warnings(false);  // of threads that run when Python ends: nobody can help that
  module.def("version", &pendula_version);
  module.def("instruction_set", &pendula_instruction_set);
  nb::exception<io::InputError>(module, "InputError", PyExc_ValueError);  // NOLINT(bugprone-unused-raii)
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
      .def_ro("state", &Result::state)
      .def_ro("summary", &Result::summary)
      .def_prop_ro("events", [](const Result& result) { return result.recorder.events; })
      .def("take_rows", [](Result& result) { return array_of(std::move(result.recorder.rows), result.columns.size()); })
      .def("take_event_rows",
           [](Result& result) { return array_of(std::move(result.recorder.event_rows), result.columns.size()); });
  module.def("simulate", &simulate, nb::arg("text"), nb::arg("name"), nb::arg("overrides"), nb::arg("program"),
             nb::arg("python"), nb::arg("tell"));

  nb::exception<RunFailed>(module, "StepFailed", PyExc_RuntimeError);  // NOLINT(bugprone-unused-raii)
  nb::class_<Prepared>(module, "Prepared")
      .def_prop_ro("columns", [](const Prepared& made) { return made.subject->columns(); })
      .def_prop_ro("state", [](const Prepared& made) { return state_columns(*made.subject); })
      .def_prop_ro("inputs", [](const Prepared& made) { return model_of(made).input_names(); })
      .def_ro("warnings", &Prepared::warnings);
  module.def("prepare", &prepare, nb::arg("text"), nb::arg("program"), nb::arg("python"), nb::arg("tell"),
             nb::arg("remembers"));

  nb::class_<Moved>(module, "Simulation")
      .def("__init__",
           [](Moved* self, const std::shared_ptr<const Prepared>& made) {
             new (self) Moved{made, Simulation(model_of(*made), made->start, made->options)};
           })
      .def("copy", [](const Moved& self) { return Moved(self); })
      .def_prop_ro("time", [](const Moved& self) { return self.simulation.time(); })
      .def_prop_ro("steps", [](const Moved& self) { return self.simulation.steps(); })
      .def_prop_ro(
          "state", [](const Moved& self) { return vector_of(state_of(self.simulation.motion())); }, nb::rv_policy::move)
      .def("advance_to",
           [](Moved& self, double time) {
             Interruption interruption;
             {
               const nb::gil_scoped_release others_may_go_on;
               const Heeding heeding(self.simulation, interruption);
               self.simulation.advance_to(time);
             }
             if (interruption.is_requested()) throw nb::python_error();
           })
      .def("at", [](Moved& self, double time) { return vector_of(state_of(self.simulation.at(time))); })
      .def("number", [](const Moved& self, const std::string& column) { return self.simulation[column]; })
      .def("hold",
           [](Moved& self, const std::vector<double>& inputs) {
             self.simulation.hold(
                 Eigen::Map<const Eigen::VectorXd>(inputs.data(), static_cast<Eigen::Index>(inputs.size())));
           })
      .def_prop_ro("held",
                   [](const Moved& self) {
                     const Eigen::VectorXd held = self.simulation.held();
                     return std::vector<double>(held.data(), held.data() + held.size());
                   })
      .def("linearize",
           [](const Moved& self) {
             const auto [a, b] = self.simulation.linearize();
             return std::pair(array_of(a), array_of(b));
           })
      .def("save", [](const Moved& self) { return vector_of(self.simulation.save().numbers); })
      .def("resume", [](Moved& self, const Numbers& saved) {
        self.simulation.resume({std::vector<double>(saved.data(), saved.data() + saved.size())});
      });

  module.def("propagate", &propagate_all);

  module.def("lyapunov",
             [](const Prepared& made, double duration,
                int count) -> nb::typed<nb::tuple, Vector, Vector, double, double, double, double> {
               LyapunovSpectrum found;
               interruptibly([&](const std::stop_token& stop) {
                 found = lyapunov(model_of(made), made.start,
                                  {.duration = duration, .count = count, .run = made.options, .stop = stop});
               });
               return nb::make_tuple(vector_of(found.exponents), vector_of(found.errors), found.sum, found.duration,
                                     found.ftle, found.megno);
             });
}

}  // namespace
}  // namespace pendula::python

NB_MODULE(_core, module) {
  pendula::python::define(module);
}
