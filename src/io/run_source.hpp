#pragma once

#include <filesystem>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <string>
#include <vector>

#include "io/run_file.hpp"
#include "io/scenario.hpp"

namespace pendula::io {

/// The source of a run: a scenario, or a run file to resume.
struct RunSource {
  ScenarioText text;
  std::vector<std::string> overrides;  ///< those of the file and of the command line
  std::optional<SavedRun> saved;       ///< the run to resume
};

/// The source of a resumed run, `saved` in `file`, with overrides of keys that may change. Throws InputError for other
/// keys, and if this program cannot resume the run.
RunSource resumed_source(const std::string& file, SavedRun saved, const std::vector<std::string>& overrides);

/// Throws ModelError if a saved run has another model; `model` is the text of the model's file.
void require_same_model(const RunSource& source, const std::string& model);

/// The folder in which the model file of a resumed run is found: `folder` as named by the scenario, relative to the
/// working folder or to the run file.
std::filesystem::path model_folder(const std::string& run_file, const std::string& model,
                                   const std::filesystem::path& folder);

/// The origin of a run, for its file.
RunOrigin origin_of(const RunSource& source, const Description& description, const std::string& model,
                    const std::string& command, const std::string& title);

/// The overrides of a run, and those that put numbers in place of the files of its signals, so that a run file needs no
/// other file.
std::vector<std::string> overrides_with_numbers(const RunSource& source, const std::vector<SignalPlan>& signals);

/// The checkpoint to resume from, for a checked scenario. Throws InputError if the scenario ends before it.
std::optional<Checkpoint> checkpoint_of(const RunSource& source, double end);

}  // namespace pendula::io
