// Runs of scenarios in this process, with rows and events as arrays.

#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>
#include <stdlib.h>

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <memory>
#include <pendula/run/run.hpp>
#include <pendula/run/state_columns.hpp>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "interruption.hpp"
#include "io/errors.hpp"
#include "io/generator.hpp"
#include "io/kernel_cache.hpp"
#include "io/run_source.hpp"
#include "io/scenario_run.hpp"
#include "io/summary.hpp"
#include "run_result.hpp"
#include "toolchain.hpp"
#include "view/page.hpp"
#include "view/scenario_scene.hpp"

namespace pendula::python {
namespace {

namespace fs = std::filesystem;

/// A model file for as long as its kernel is looked for.
class ModelFile {
 public:
  ModelFile(const std::string& model, const std::string& text) {
    std::string name = (fs::temp_directory_path() / "pendula-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw io::ModelError("expected a folder for temporary files, got none");
    folder_ = name;
    file_ = folder_ / (fs::path(model).stem().string() + ".py");
    std::ofstream(file_) << text;
  }
  ModelFile(const ModelFile&) = delete;
  ModelFile& operator=(const ModelFile&) = delete;
  ~ModelFile() {
    std::error_code none;
    fs::remove_all(folder_, none);
  }
  std::string name() const { return file_.string(); }

 private:
  fs::path folder_, file_;
};

/// The model and the scenario of a run; act(scenario, setup, model, stop) is called without Python's lock. Throws what
/// Python has raised meanwhile: Ctrl-C, and exceptions of functions.
template <class Do>
void with_scenario(const io::RunSource& source, RunModel model, const PythonEvents& asked, Do act) {
  Interruption interruption;
  {
    const nb::gil_scoped_release others_may_go_on;
    const io::AnyScenario any =
        io::parse_scenario(source.text.text, source.text.name, source.overrides, model.finder());
    std::visit(
        [&](const auto& scenario) {
          RunSetup setup = io::setup_of(scenario);
          asked.add_to(setup.events);
          act(scenario, std::move(setup), model, [&] { return interruption() || asked.has_failed(); });
        },
        any);
  }
  if (interruption.is_requested()) throw nb::python_error();
  asked.rethrow();
}

/// The source of the same run again. Throws io::InputError where this build does not make it to the bit.
io::RunSource again_of(const Result& result) {
  io::SavedRun saved = result.saved;
  if (!result.rows.empty()) saved.end = result.rows[result.rows.size() - result.columns.size()];
  return io::resumed_source(result.file, std::move(saved), {});
}

/// Throws io::InputError if functions are missing that were asked by the run.
void require_its_events(const Result& result, const RunSetup& setup) {
  if (io::event_names(setup) == result.contents.events) return;
  throw io::InputError(result.file + ": expected a run whose events are expressions, got one with functions of Python");
}

/// What a run has before it goes on.
void begin_with(const Result& before, Result& result) {
  const auto copy = [](const auto& from, auto& to, std::size_t count) {
    to.assign(from.begin(), from.begin() + static_cast<std::ptrdiff_t>(count));
  };
  const std::size_t columns = before.columns.size(),
                    rows = before.saved.has_rows ? static_cast<std::size_t>(before.saved.checkpoint->rows) : 0,
                    events = before.saved.so_far ? before.saved.so_far->events : 0;
  copy(before.rows, result.rows, rows * columns);
  copy(before.events, result.events, events);
  copy(before.went_up, result.went_up, events);
  copy(before.event_rows, result.event_rows, events * columns);
  result.saved.has_rows = before.saved.has_rows;
}

/// Tells Python from time to time how far a run is, if it takes long.
class Progress : public Observer {
 public:
  explicit Progress(const nb::object& tell) : tell_(tell) {}

  void take(const Row& row) override {
    const auto now = std::chrono::steady_clock::now();
    if (tell_.is_none() || now < next_) return;
    next_ = now + std::chrono::milliseconds(100);
    const nb::gil_scoped_acquire lock;
    tell_(row.motion.time);
  }

 private:
  const nb::object& tell_;
  std::chrono::steady_clock::time_point next_ = std::chrono::steady_clock::now() + std::chrono::seconds(1);
};

/// Makes a run, or goes on with one.
std::unique_ptr<Result> make_run(const io::RunSource& source, RunModel model, PythonEvents asked, const Result* before,
                                 const nb::object& progress) {
  auto result = std::make_unique<Result>();
  result->file = source.text.name;
  result->asked = std::move(asked);
  with_scenario(source, std::move(model), result->asked,
                [&](const auto& scenario, RunSetup setup, RunModel& found, const auto& stop) {
                  describe(setup, io::contents_of(setup, scenario), view::subject_scene(scenario), *result);
                  const std::optional<Checkpoint> from = io::checkpoint_of(source, setup.start.time + setup.duration);
                  Run run = io::told_at_keys(scenario, source.text.name, [&] { return Run(setup); });
                  const view::Scene scene = view::scene_of(scenario, source);
                  result->saved.origin = io::origin_of(source, run.description(), found.text(), saved_by,
                                                       scene.title + ": " + scene.subject);
                  result->saved.origin.overrides = io::overrides_with_numbers(source, scenario.signals);
                  if (before != nullptr) require_its_events(*before, setup);
                  if (from) begin_with(*before, *result);
                  Recorder recorder(*result);
                  run.add(recorder);
                  Progress telling(progress);
                  run.add(telling);
                  io::Summary summary;
                  std::vector<std::string> warnings = scenario.warnings;
                  for (std::string& trouble : run.expected_trouble()) warnings.push_back(std::move(trouble));
                  try {
                    static_cast<RunReport&>(summary) = from ? run.go_on(*from, stop) : run.go(stop);
                  } catch (const std::invalid_argument& error) {
                    throw io::InputError(source.text.name +
                                         ": expected a run of this version of pendula, which keeps other numbers (" +
                                         error.what() + ")");
                  }
                  for (std::string& warning : summary.warnings) warnings.push_back(std::move(warning));
                  summary.warnings = std::move(warnings);
                  io::describe(run.setup(), summary);
                  summary.kernel_by = found.by();
                  io::describe(scenario, source.text.name, summary);
                  result->summary = io::to_json(summary);
                  result->file_summary = io::to_json_of_file(summary);
                });
  return result;
}

std::unique_ptr<Result> simulate(const std::string& text, const std::string& name,
                                 const std::vector<std::string>& overrides,
                                 const std::vector<std::tuple<std::string, nb::object, int, bool>>& events,
                                 const nb::object& progress, const std::string& program, const std::string& python,
                                 const Tell& tell) {
  std::vector<PythonEvent> asked;
  for (const auto& [event, function, direction, stop] : events) {
    asked.push_back({event, nb::cast<nb::callable>(function), direction, stop});
  }
  return make_run({{name, text}, overrides, {}}, RunModel(program, python, tell), PythonEvents(std::move(asked)),
                  nullptr, progress);
}

std::unique_ptr<Result> go_on(const Result& before, const std::vector<std::string>& overrides,
                              const nb::object& progress, const std::string& program, const std::string& python,
                              const Tell& tell) {
  return make_run(io::resumed_source(before.file, before.saved, overrides),
                  RunModel(program, python, tell, before.saved.origin.model), before.asked, &before, progress);
}

/// Rows of the same run at other times from its start, ascending.
Array rows_at(const Result& result, const std::vector<double>& times, const std::string& program,
              const std::string& python, const Tell& tell) {
  Result again;
  const std::size_t wanted = times.size() * result.columns.size();
  with_scenario(again_of(result), RunModel(program, python, tell, result.saved.origin.model), result.asked,
                [&](const auto&, RunSetup setup, RunModel&, const auto& stop) {
                  require_its_events(result, setup);
                  setup.rows = {0, times};
                  setup.judged = false;
                  Run run(setup);
                  Recorder recorder(again);
                  run.add(recorder);
                  run.go([&] { return stop() || again.rows.size() >= wanted; });
                });
  return array_of(std::move(again.rows), result.columns.size());
}

/// What the same run begins with.
std::shared_ptr<Prepared> prepare_again(const Result& result, const std::string& program, const std::string& python,
                                        const Tell& tell) {
  const io::RunSource source = again_of(result);
  const nb::gil_scoped_release others_may_go_on;
  RunModel model(program, python, tell, result.saved.origin.model);
  return prepared(io::parse_scenario(source.text.text, source.text.name, source.overrides, model.finder()));
}

/// Knows the time of the last row.
class Clock : public Observer {
 public:
  void take(const Row& row) override { time = row.motion.time; }
  double time = 0;
};

/// Writes the page of a run, as far as it came.
void write_page(const Result& result, const std::string& file, const std::string& program, const std::string& python,
                const Tell& tell) {
  const io::RunSource source = again_of(result);
  with_scenario(source, RunModel(program, python, tell, result.saved.origin.model), result.asked,
                [&](const auto& scenario, RunSetup setup, RunModel&, const auto& stop) {
                  require_its_events(result, setup);
                  setup.judged = false;
                  view::Page page(file, view::scene_of(scenario, source));
                  page.begin_run("");
                  Run run(setup);
                  run.add(page, page.times(setup.duration));
                  const double last = result.rows.empty() ? 0 : result.rows[result.rows.size() - result.columns.size()];
                  Clock clock;
                  run.add(clock);
                  const bool is_whole = last >= setup.start.time + setup.duration;
                  page.end_run(run.go([&] { return stop() || (!is_whole && clock.time >= last); }).energy_error);
                  page.close();
                });
}

/// A view into the numbers of a result.
using Table = nb::ndarray<nb::numpy, const double, nb::ndim<2>>;
Table table_of(const Result& result, const std::vector<double>& numbers) {
  const std::size_t columns = result.columns.size();
  return Table(numbers.data(), {columns == 0 ? 0 : numbers.size() / columns, columns});
}

}  // namespace

void describe(const RunSetup& setup, io::RunContents contents, const view::Scene& scene, Result& result) {
  const Subject& subject = *setup.subject;
  result.begin = setup.start.time;
  result.loaded = subject.loaded();
  contents.drawing = view::drawing_of(scene);
  for (const view::Point& point : scene.points) {
    std::vector<std::size_t>& columns = result.points.emplace_back();
    for (int k = 0; k < point.components; ++k) columns.push_back(point.column + static_cast<std::size_t>(k));
  }
  result.contents = std::move(contents);
  result.columns = subject.columns();
  result.state = state_columns(subject);
  result.units.resize(result.columns.size());
  for (const Quantity& quantity : result.contents.quantities) {
    const std::string unit = io::in_units(result.contents.natural, quantity.unit);
    for (std::size_t k = 0; k < quantity.size(); ++k) result.units[quantity.column(k)] = unit;
  }
}

RunModel::RunModel(const std::string& program, const std::string& python, const Tell& tell, std::string began_with)
    : toolchain_(toolchain_of(program, python)), models_(program, python, tell), text_(std::move(began_with)) {}

io::FindSystem RunModel::finder() {
  return [this, find = models_.finder()](io::ModelName name) {
    if (text_.empty()) {
      text_ = io::model_source(name, toolchain_);
      return find(name);
    }
    const ModelFile file(name.model, text_);
    name.model = file.name();
    name.folder.clear();
    return find(name);
  };
}

void define_runs(nb::module_& module) {
  nb::class_<Result>(module, "Result")
      .def_ro("columns", &Result::columns)
      .def_ro("units", &Result::units)
      .def_ro("state", &Result::state)
      .def_ro("points", &Result::points)
      .def_ro("begin", &Result::begin)
      .def_ro("loaded", &Result::loaded)
      .def_ro("summary", &Result::summary)
      .def_ro("events", &Result::events)
      .def_prop_ro("event_names", [](const Result& result) { return result.contents.events; })
      .def_prop_ro(
          "rows", [](const Result& result) { return table_of(result, result.rows); }, nb::rv_policy::reference_internal)
      .def_prop_ro(
          "event_rows", [](const Result& result) { return table_of(result, result.event_rows); },
          nb::rv_policy::reference_internal);
  module.def("simulate", &simulate, nb::arg("text"), nb::arg("name"), nb::arg("overrides"), nb::arg("events"),
             nb::arg("progress").none(), nb::arg("program"), nb::arg("python"), nb::arg("tell"));
  module.def("go_on", &go_on, nb::arg("before"), nb::arg("overrides"), nb::arg("progress").none(), nb::arg("program"),
             nb::arg("python"), nb::arg("tell"));
  module.def("rows_at", &rows_at, nb::arg("result"), nb::arg("times"), nb::arg("program"), nb::arg("python"),
             nb::arg("tell"));
  module.def("prepare_again", &prepare_again, nb::arg("result"), nb::arg("program"), nb::arg("python"),
             nb::arg("tell"));
  module.def("write_page", &write_page, nb::arg("result"), nb::arg("file"), nb::arg("program"), nb::arg("python"),
             nb::arg("tell"));
}

}  // namespace pendula::python
