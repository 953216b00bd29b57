#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "io/errors.hpp"
#include "io/event_reader.hpp"
#include "io/feedback_reader.hpp"
#include "io/model_name.hpp"
#include "io/natural_units.hpp"
#include "io/own_columns.hpp"
#include "io/signal_reader.hpp"
#include "io/toml_reader.hpp"

namespace pendula::io {

/// Most steps of a run: beyond 2⁵³ a step no longer changes the time.
inline constexpr double max_steps = 9e15;

/// What a scenario says about a run, checked.
struct RunPlan : RunRequest {
  std::vector<EventPlan> events;
  std::vector<FeedbackPlan> feedback;
  std::vector<SignalPlan> signals;
  std::vector<ColumnPlan> columns;      ///< of rows, besides those of the motion
  std::optional<NaturalUnits> natural;  ///< units of all numbers of the scenario; empty for SI
  std::vector<std::string> warnings;    ///< one sentence each
  /// Where keys stand, as `where: key`, for later errors: the keys of [run] by name, and by "links" what tells the
  /// number of links.
  std::map<std::string, std::string, std::less<>> places;
};

/// A chain to run. Numbers are in SI, or all in `natural` units where the file says so.
template <class Space>
struct Scenario : RunPlan {
  Chain<Space> chain;
  State<Space> start;
  double closed_by = 0;  ///< the largest change of an angle that brought the end to its hook  [rad]
  bool hangs = false;    ///< whether angles are those of a chain at rest between its hooks

  Scenario(Chain<Space> moved, State<Space> from) : chain(std::move(moved)), start(std::move(from)) {}
};

/// Any other system to run.
struct SystemScenario : RunPlan {
  std::shared_ptr<const SystemSubject> system;
  Motion start;
  std::vector<std::pair<std::string, double>> assembled;  ///< coordinates and rates that constraints gave
  std::vector<std::pair<std::string, double>> guesses;    ///< of these coordinates
  int constraints = 0;                                    ///< that do not follow from others at the start
};

using AnyScenario = std::variant<Scenario<Planar>, Scenario<Spatial>, SystemScenario>;

/// Finds the kernel of the model that a scenario names, whose folder is the scenario's. Throws ModelError.
using FindSystem = std::function<std::shared_ptr<const SystemTable>(const ModelName& name)>;

/// Finds kernels of this build only.
std::shared_ptr<const SystemTable> built_in_system(const ModelName& model);

/// Reads a scenario from TOML text; `name` stands for the file in messages. Each override is `key.path=value`, the
/// value in TOML, or a bare word for a string; it replaces what the text says. Keys and defaults:
/// docs/reference/scenario.md.
/// Throws InputError with a message `name:line: key: expected …, got …`, or `--set key.path=value: key: …`.
AnyScenario parse_scenario(std::string_view text, std::string_view name, std::span<const std::string> overrides = {},
                           const FindSystem& find = built_in_system);

/// Reads a scenario from its document. Throws InputError.
AnyScenario read_document(const toml::table& document, std::string_view name, const FindSystem& find);

/// Reads a scenario from a file; "-" is standard input. Throws InputError, too, if the file cannot be read.
AnyScenario read_scenario(const std::filesystem::path& file, std::span<const std::string> overrides = {},
                          const FindSystem& find = built_in_system);

}  // namespace pendula::io
