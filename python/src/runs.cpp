// Runs of scenarios in this process, with rows and events as arrays.

#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <pendula/run/observer.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/state_columns.hpp>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "interruption.hpp"
#include "io/scenario_run.hpp"
#include "io/summary.hpp"
#include "prepared.hpp"

namespace pendula::python {
namespace {

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

/// What came of a run.
struct Result {
  std::vector<std::string> columns, units;
  std::vector<std::size_t> state;  ///< columns of the coordinates, then of their rates
  Recorder recorder;
  std::string summary;  ///< as `pendula simulate --json` prints it
};

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

}  // namespace

void define_runs(nb::module_& module) {
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
}

}  // namespace pendula::python
