#include "cli/run_source.hpp"

#include <algorithm>
#include <filesystem>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <string_view>
#include <system_error>

#include "io/input_error.hpp"
#include "io/provenance.hpp"
#include "io/scenario_keys.hpp"

namespace pendula::cli {
namespace {

std::string key_of(const std::string& change) {
  return change.substr(0, change.find_first_of("= "));
}

/// Throws io::InputError if overrides change a key that must stay the same in a resumed run.
void require_free(const std::vector<std::string>& overrides) {
  const auto may_change = [](std::string_view key) {
    const io::ScenarioKey* const known = io::find_key(key);
    return known != nullptr && known->may_change;
  };
  std::string free;
  for (const std::string_view key : io::all_keys()) {
    if (may_change(key)) free.append(free.empty() ? "" : " or ").append(key);
  }
  const auto wrong = std::ranges::find_if_not(overrides, may_change, key_of);
  if (wrong == overrides.end()) return;
  throw io::InputError("--set " + *wrong + ": expected " + free + ", which a run that goes on may have anew, got " +
                       key_of(*wrong));
}

void require_same(const std::string& file, const std::string& what, const std::string& here, const std::string& got) {
  if (got == here) return;
  throw io::InputError(file + ": expected a run of " + what + " " + here + ", got one of " + got);
}

/// Throws io::InputError unless the solver is the one of the checkpoint: it may depend on the kernels of a build.
void require_same_solver(const io::RunOrigin& began, const io::RunOrigin& here) {
  if (began.solver == here.solver && began.kernel == here.kernel) return;
  const auto told = [](const io::RunOrigin& origin) {
    return "solver \"" + origin.solver + "\"" + (origin.kernel.empty() ? "" : " on the kernel " + origin.kernel);
  };
  throw io::InputError(began.scenario_name + ": the run began by " + told(began) + ", and this build would go on by " +
                       told(here) + ": go on with a build that has the same kernels");
}

}  // namespace

RunSource read_run_source(const SimulateOptions& options) {
  if (!options.resume) return {io::read_scenario_text(options.scenario), options.overrides, {}};
  const std::string& file = *options.resume;
  require_free(options.overrides);
  RunSource source{{}, {}, io::read_saved_run(file)};
  const io::RunOrigin& origin = source.saved->origin;
  require_same(file, "pendula", std::string(version), origin.version);
  const std::string instruction_set(library().instruction_set);
  if (origin.instruction_set != instruction_set) {
    throw io::InputError(file + ": expected a run on " + instruction_set + ", got one on " + origin.instruction_set +
                         ", which others do not follow to the last bit; PENDULA_ARCH=" + origin.instruction_set +
                         " in the environment asks for it");
  }
  source.text = {origin.scenario_name, origin.scenario};
  source.overrides = origin.overrides;
  for (const std::string& change : options.overrides) {
    std::erase_if(source.overrides, [&](const std::string& before) { return key_of(before) == key_of(change); });
  }
  source.overrides.insert(source.overrides.end(), options.overrides.begin(), options.overrides.end());
  return source;
}

void require_same_model(const RunSource& source, const std::string& model) {
  if (!source.saved || source.saved->origin.model == model) return;
  throw io::ModelError("the model is no longer the one that the run began with");
}

std::filesystem::path model_folder(const std::string& run_file, const std::string& model,
                                   const std::filesystem::path& folder) {
  std::error_code unknown;
  if (std::filesystem::exists(folder / model, unknown)) return folder;
  return std::filesystem::path(run_file).parent_path() / folder;
}

io::RunOrigin origin_of(const RunSource& source, const Description& description, const std::string& model,
                        const std::string& command, const std::string& title) {
  io::RunOrigin origin;
  origin.title = title;
  origin.command = command;
  origin.version = version;
  origin.instruction_set = library().instruction_set;
  origin.solver = description.solver;
  origin.kernel = description.kernel;
  origin.scenario_name = io::public_name(source.text.name);
  origin.scenario = source.text.text;
  origin.overrides = source.overrides;
  origin.model = model;
  if (source.saved) {
    require_same_solver(source.saved->origin, origin);
    origin.history = source.saved->origin.history;
  }
  return origin;
}

std::optional<Checkpoint> checkpoint_of(const RunSource& source, double end) {
  if (!source.saved || !source.saved->checkpoint) return std::nullopt;
  const Checkpoint& checkpoint = *source.saved->checkpoint;
  if (checkpoint.time <= end) return checkpoint;
  throw io::InputError("run.duration: expected at least " + shortest(checkpoint.time) +
                       ", where the run is already, got " + shortest(end));
}

}  // namespace pendula::cli
