#include "io/run_source.hpp"

#include <algorithm>
#include <filesystem>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <string_view>
#include <system_error>

#include "io/errors.hpp"
#include "io/provenance.hpp"
#include "io/scenario_keys.hpp"
#include "io/section.hpp"
#include "io/toml_reader.hpp"

namespace pendula::io {
namespace {

std::string key_of(const std::string& change) {
  return change.substr(0, change.find_first_of("= "));
}

/// Throws InputError if overrides change a key that must stay the same in a resumed run.
void require_free(const std::vector<std::string>& overrides) {
  const auto may_change = [](std::string_view key) {
    const ScenarioKey* const known = find_key(key);
    return known != nullptr && known->may_change;
  };
  std::string free;
  for (const std::string_view key : all_keys()) {
    if (may_change(key)) free.append(free.empty() ? "" : " or ").append(key);
  }
  const auto wrong = std::ranges::find_if_not(overrides, may_change, key_of);
  if (wrong == overrides.end()) return;
  throw InputError("--set " + *wrong + ": expected " + free + ", which a run that goes on may have anew, got " +
                   key_of(*wrong));
}

void require_same(const std::string& file, const std::string& what, const std::string& here, const std::string& got) {
  if (got == here) return;
  throw InputError(file + ": expected a run of " + what + " " + here + ", got one of " + got);
}

/// Throws InputError unless the solver is that of the checkpoint; it may depend on the kernels of a build.
void require_same_solver(const RunOrigin& began, const RunOrigin& here) {
  if (began.solver == here.solver && began.kernel == here.kernel) return;
  const auto told = [](const RunOrigin& origin) {
    return "solver \"" + origin.solver + "\"" + (origin.kernel.empty() ? "" : " on the kernel " + origin.kernel);
  };
  throw InputError(began.scenario_name + ": the run began by " + told(began) + ", and this build would go on by " +
                   told(here) + ": go on with a build that has the same kernels");
}

/// Numbers as a TOML array.
std::string array_of(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "[" : ", ") + shortest(number);
  return text + "]";
}

}  // namespace

RunSource resumed_source(const std::string& file, SavedRun saved, const std::vector<std::string>& overrides) {
  require_free(overrides);
  RunSource source{{saved.origin.scenario_name, saved.origin.scenario}, saved.origin.overrides, std::move(saved)};
  const RunOrigin& origin = source.saved->origin;
  require_same(file, "pendula", std::string(version), origin.version);
  const std::string instruction_set(pendula::instruction_set());
  if (origin.instruction_set != instruction_set) {
    throw InputError(file + ": expected a run on " + instruction_set + ", got one on " + origin.instruction_set +
                     ", which others do not follow to the last bit; PENDULA_ARCH=" + origin.instruction_set +
                     " in the environment asks for it");
  }
  for (const std::string& change : overrides) {
    std::erase_if(source.overrides, [&](const std::string& before) { return key_of(before) == key_of(change); });
  }
  source.overrides.insert(source.overrides.end(), overrides.begin(), overrides.end());
  return source;
}

void require_same_model(const RunSource& source, const std::string& model) {
  if (!source.saved || source.saved->origin.model == model) return;
  throw ModelError("the model is no longer the one that the run began with");
}

std::filesystem::path model_folder(const std::string& run_file, const std::string& model,
                                   const std::filesystem::path& folder) {
  std::error_code unknown;
  if (std::filesystem::exists(folder / model, unknown)) return folder;
  return std::filesystem::path(run_file).parent_path() / folder;
}

RunOrigin origin_of(const RunSource& source, const Description& description, const std::string& model,
                    const std::string& command, const std::string& title) {
  RunOrigin origin;
  origin.title = title;
  origin.command = command;
  origin.version = version;
  origin.instruction_set = instruction_set();
  origin.solver = description.solver;
  origin.kernel = description.kernel;
  origin.scenario_name = public_name(source.text.name);
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
  const double reached = std::max(checkpoint.time, source.saved->end);
  if (reached <= end) return checkpoint;
  throw InputError("run.duration: expected at least " + shortest(reached) + ", where the run is already, got " +
                   shortest(end));
}

std::vector<std::string> overrides_with_numbers(const RunSource& source, const std::vector<SignalPlan>& signals) {
  std::vector<std::string> overrides = source.overrides;
  if (signals.empty()) return overrides;
  const toml::table document = parse_toml(source.text.text, source.text.name, source.overrides);
  const std::string kind = document.contains("system") ? "system" : "chain";
  for (std::size_t k = 0; k < signals.size(); ++k) {
    if (!document[kind]["signal"][k]["file"]) continue;
    const SignalPlan& plan = signals[k];
    overrides.push_back(kind + ".signal[" + std::to_string(k + 1) + "]={input=" + toml_string(plan.input) +
                        ", hold=" + (plan.signal.is_held ? "true" : "false") +
                        ", times=" + array_of(plan.signal.times) + ", values=" + array_of(plan.signal.values) + "}");
  }
  return overrides;
}

}  // namespace pendula::io
