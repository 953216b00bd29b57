#include "cli/output_files.hpp"

#include <cstddef>
#include <filesystem>
#include <iostream>
#include <system_error>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/run_file.hpp"
#include "io/trajectory.hpp"

namespace pendula::cli {
namespace {

bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code none_there;
  const auto whole = [](const std::filesystem::path& path) {
    return std::filesystem::absolute(path).lexically_normal();
  };
  return whole(a) == whole(b) || std::filesystem::equivalent(a, b, none_there);
}

/// Opens the file for the rows; a resumed run file begins with its old rows.
std::unique_ptr<io::RowsFile> make_rows_file(const std::string& file, const SimulateOptions& options,
                                             const io::RunOrigin& origin, const std::optional<io::SavedRun>& saved,
                                             const io::RunContents& contents) {
  if (!is_run_file(file, options)) return std::make_unique<io::TrajectoryFile>(file, columns_of(contents.quantities));
  if (!saved) return std::make_unique<io::RunFile>(file, origin, contents);
  return std::make_unique<io::RunFile>(file, *options.resume, *saved, origin, contents);
}

}  // namespace

void spare_scenario(const std::string& file, const char* what, const SimulateOptions& options) {
  if (file == "-" || options.resume || !is_same_file(file, options.scenario)) return;
  throw io::InputError(file + ": expected a file for the " + what + ", got the scenario itself");
}

bool is_run_file(const std::string& file, const SimulateOptions& options) {
  return file == options.resume || io::format_of(file) == io::FileFormat::hdf5;
}

void check_names(const SimulateOptions& options) {
  if (options.output) {
    spare_scenario(*options.output, "trajectory", options);
    is_run_file(*options.output, options);
  }
  if (!options.events) return;
  spare_scenario(*options.events, "events", options);
  if (*options.events == "-") throw io::InputError("-: expected a file of its own for the events");
  io::require_format(*options.events, io::FileFormat::csv, "events (a run file, -o run.h5, has them, too)");
}

std::optional<std::string> output_of(const io::RunSource& source, const SimulateOptions& options) {
  const bool without_rows = source.saved && !source.saved->has_rows;
  if (!options.output) return without_rows ? std::nullopt : options.resume;
  if (without_rows && is_run_file(*options.output, options)) {
    throw io::InputError(*options.output + ": expected a CSV file, got a run file, which begins with rows that " +
                         *options.resume + " does not have");
  }
  return options.output;
}

std::unique_ptr<io::RowsFile> open_rows(const std::optional<std::string>& file, const SimulateOptions& options,
                                        const io::RunOrigin& origin, const std::optional<io::SavedRun>& saved,
                                        const io::RunContents& contents) {
  if (!file) return nullptr;
  std::error_code unknown;
  const bool replaces = file != options.resume && std::filesystem::is_regular_file(*file, unknown);
  auto opened = make_rows_file(*file, options, origin, saved, contents);
  if (replaces && !options.quiet) std::cerr << "pendula: replacing " << *file << '\n';
  return opened;
}

void require_page(const std::string& file) {
  if (!file.ends_with(".html")) throw io::InputError(file + ": expected a name that ends in .html");
}

std::unique_ptr<view::Page> open_page(const SimulateOptions& options, const view::Scene& scene) {
  if (!options.view) return nullptr;
  spare_scenario(*options.view, "page", options);
  if (*options.view == "-" || (options.output && is_same_file(*options.view, *options.output))) {
    throw io::InputError(*options.view + ": expected a file of its own for the page");
  }
  require_page(*options.view);
  return std::make_unique<view::Page>(*options.view, scene, 1 + static_cast<std::size_t>(options.copies));
}

void check_events(const SimulateOptions& options, const RunSetup& setup) {
  if (!options.events) return;
  const auto is_taken = [&](const std::optional<std::string>& file) {
    return file && is_same_file(*options.events, *file);
  };
  if (is_taken(options.output) || is_taken(options.view) || is_taken(options.resume)) {
    throw io::InputError(*options.events + ": expected a file of its own for the events");
  }
  if (!setup.events.empty()) return;
  throw io::InputError("--events " + *options.events + ": expected a scenario with [[event]], got one without");
}

std::unique_ptr<io::EventFile> open_events(const SimulateOptions& options, const RunSetup& setup) {
  if (!options.events) return nullptr;
  return std::make_unique<io::EventFile>(*options.events, setup.subject->columns());
}

}  // namespace pendula::cli
