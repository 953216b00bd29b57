// Runs as files.

#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <cstddef>
#include <memory>
#include <nlohmann/json.hpp>
#include <pendula/numeric/number_text.hpp>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "bindings.hpp"
#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/provenance.hpp"
#include "io/run_arrays.hpp"
#include "io/run_file.hpp"
#include "io/scenario_run.hpp"
#include "io/trajectory.hpp"
#include "run_result.hpp"
#include "view/scenario_scene.hpp"

namespace pendula::python {
namespace {

/// The k-th row of a table.
std::span<const double> row_of(const std::vector<double>& table, std::size_t columns, std::size_t k) {
  return std::span(table).subspan(k * columns, columns);
}

/// The summary that a file has, of a run whose rows are in `file`.
std::string summary_in(const Result& result, const std::string& file) {
  if (result.file_summary.empty()) return {};
  nlohmann::ordered_json summary = nlohmann::ordered_json::parse(result.file_summary);
  summary["trajectory"] = io::public_name(file);
  return summary.dump();
}

/// Tells an observer what a run told when it was made: what the file has is the same.
void tell_again(const Result& result, Observer& observer) {
  const std::size_t columns = result.columns.size(), rows = result.count_rows();
  const auto kept = result.saved.checkpoint ? static_cast<std::size_t>(result.saved.checkpoint->rows) : rows + 1;
  const Motion nowhere;
  const Observation unseen;
  std::size_t told = 0;
  const auto tell_events = [&](std::size_t end) {
    for (; told < end; ++told) {
      Event event;
      event.name = result.events[told];
      observer.happen({event, result.went_up[told] != 0, {nowhere, unseen, row_of(result.event_rows, columns, told)}});
    }
  };
  for (std::size_t k = 0; k <= rows; ++k) {
    if (k == kept) {
      tell_events(result.saved.so_far ? result.saved.so_far->events : result.events.size());
      observer.keep(*result.saved.checkpoint);
    }
    if (k < rows) observer.take({nowhere, unseen, row_of(result.rows, columns, k)});
  }
  tell_events(result.events.size());
  observer.finish();
}

/// Fills in rows and events. Throws io::InputError.
void read_rows(const std::string& file, Result& result) {
  io::guarded_source(file, [&] {
    const io::hdf5::Handle opened = io::hdf5::open_file(file);
    result.file_summary = result.summary = io::hdf5::read_late_text(io::hdf5::open_group(opened, "run"), "summary");
    const std::size_t rows = io::hdf5::extent(io::hdf5::open_dataset(opened, "t"))[0];
    result.rows = io::read_block(opened, result.contents.quantities, 0, rows);
    if (!io::hdf5::has(opened, "events")) return;
    const io::hdf5::Handle group = io::hdf5::open_group(opened, "events");
    result.contents.events = io::event_names(group);
    for (const auto& event : io::read_events(group, result.contents.quantities, 0, io::count_events(group))) {
      const auto which = static_cast<std::size_t>(event[1]) - 1;
      if (which >= result.contents.events.size()) throw io::ChangedFile("one whose events have other numbers");
      result.events.push_back(result.contents.events[which]);
      result.went_up.push_back(event[2] != 0 ? 1 : 0);
      result.event_rows.insert(result.event_rows.end(), event.begin() + 3, event.end());
    }
  });
}

std::unique_ptr<Result> open(const std::string& file, const std::string& program, const std::string& python,
                             const Tell& tell) {
  auto result = std::make_unique<Result>();
  result->file = file;
  result->saved = io::read_saved_run(file);
  {
    const nb::gil_scoped_release others_may_go_on;
    const io::RunSource source{
        {result->saved.origin.scenario_name, result->saved.origin.scenario}, result->saved.origin.overrides, {}};
    RunModel model(program, python, tell, result->saved.origin.model);
    const io::AnyScenario any =
        io::parse_scenario(source.text.text, source.text.name, source.overrides, model.finder());
    std::visit(
        [&](const auto& scenario) {
          const RunSetup setup = io::setup_of(scenario);
          const view::Scene scene = view::scene_of(scenario, source);
          describe(setup, io::contents_of(setup, scenario), scene, *result);
          result->saved.origin.title = scene.title + ": " + scene.subject;
          result->saved.origin.command = saved_by;
        },
        any);
  }
  if (result->saved.has_rows) read_rows(file, *result);
  return result;
}

}  // namespace

// Python's lock is held: HDF5 knows no threads.
void save(const Result& result, const std::string& file) {
  if (io::format_of(file) == io::FileFormat::csv) {
    io::TrajectoryFile written(file, result.columns);
    tell_again(result, written);
    return;
  }
  if (!result.saved.has_rows) {
    throw io::InputError(
        file + ": expected a CSV file, got a run file, whose first rows the file that was opened does not have");
  }
  io::RunFile written(file, result.saved.origin, result.contents);
  tell_again(result, written);
  written.conclude(summary_in(result, file));
}

void define_files(nb::module_& module) {
  module.def("save", &save, nb::arg("result"), nb::arg("file"));
  module.def("open", &open, nb::arg("file"), nb::arg("program"), nb::arg("python"), nb::arg("tell"));
}

}  // namespace pendula::python
