#pragma once

#include <filesystem>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <string>
#include <vector>

#include "cli/commands.hpp"
#include "io/run_file.hpp"
#include "io/scenario.hpp"

namespace pendula::cli {

/// Where a run comes from: a scenario, or a run file that it goes on with.
struct RunSource {
  io::ScenarioText text;
  std::vector<std::string> overrides;  ///< all that were ever asked for
  std::optional<io::SavedRun> saved;   ///< of a run file
};

/// Reads it. Throws io::InputError, also where this program cannot go on with what a run file has.
RunSource read_run_source(const SimulateOptions& options);

/// Throws io::ModelError where a saved run is of another model; `model` is the text of its file.
void require_same_model(const RunSource& source, const std::string& model);

/// Where the model's file of a run that goes on is looked for: in `folder`, as the scenario named it, from where the
/// program is called, or from where the run file lies.
std::filesystem::path model_folder(const std::string& run_file, const std::string& model,
                                   const std::filesystem::path& folder);

/// What a run file is to say of the run.
io::RunOrigin origin_of(const RunSource& source, const Description& description, const std::string& model,
                        const std::string& command, const std::string& title);

/// What a run goes on from, of a scenario that was checked. Throws io::InputError where it ends before that.
std::optional<Checkpoint> checkpoint_of(const RunSource& source, double end);

}  // namespace pendula::cli
