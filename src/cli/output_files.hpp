#pragma once

#include <memory>
#include <optional>
#include <pendula/run/run_report.hpp>
#include <string>

#include "cli/commands.hpp"
#include "io/run_arrays.hpp"
#include "io/run_source.hpp"
#include "io/saved_run.hpp"
#include "io/trajectory.hpp"
#include "view/page.hpp"
#include "view/scene.hpp"

/// The files that `pendula simulate` writes. Wrong names throw io::InputError.
namespace pendula::cli {

/// Whether rows go to a run file: the one that is resumed, or one whose name has an ending of HDF5.
bool is_run_file(const std::string& file, const SimulateOptions& options);

/// Refuses a `file` for `what` that would overwrite the scenario.
void spare_scenario(const std::string& file, const char* what, const SimulateOptions& options);

/// Checks names of files before anything takes long.
void check_names(const SimulateOptions& options);

/// The file for the rows: the one that is resumed, unless it has no rows.
std::optional<std::string> output_of(const io::RunSource& source, const SimulateOptions& options);

/// Opens that file, if there is one, and tells the user what it replaces; a resumed run file begins with its old rows.
std::unique_ptr<io::RowsFile> open_rows(const std::optional<std::string>& file, const SimulateOptions& options,
                                        const io::RunOrigin& origin, const std::optional<io::SavedRun>& saved,
                                        const io::RunContents& contents);

/// Checks the name of a page.
void require_page(const std::string& file);

/// Opens the page if one is asked for.
std::unique_ptr<view::Page> open_page(const SimulateOptions& options, const view::Scene& scene);

/// Checks whether there can be a file for events.
void check_events(const SimulateOptions& options, const RunSetup& setup);

/// Opens the file for events if one is asked for.
std::unique_ptr<io::EventFile> open_events(const SimulateOptions& options, const RunSetup& setup);

}  // namespace pendula::cli
