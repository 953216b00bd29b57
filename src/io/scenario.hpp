#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/system/options.hpp>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "io/input_error.hpp"
#include "io/natural_units.hpp"

namespace pendula::io {

/// Most links that a scenario may ask for: a slip of the keyboard should not eat the memory.
inline constexpr int max_links = 1'000'000;

/// Most steps that a run may have: beyond 2⁵³ a step no longer changes the time.
inline constexpr double max_steps = 9e15;

/// A run as its file describes it, checked. Numbers are in SI, or all in `natural` units where the file says so.
template <class Space>
struct Scenario {
  Chain<Space> chain;
  State<Space> start;
  RunOptions run;
  double duration = 10;
  std::int64_t every = 10;              ///< steps from row to row
  std::optional<NaturalUnits> natural;  ///< units of all numbers here; empty for SI
  std::vector<std::string> warnings;    ///< what is odd but no error, one sentence each
  /// `where: key` of what [run] sets, by key, and of what tells the number of links, by "links": for errors yet to
  /// come.
  std::map<std::string, std::string, std::less<>> places;
};

using AnyScenario = std::variant<Scenario<Planar>, Scenario<Spatial>>;

/// Reads a scenario from TOML text; `name` stands for the file in messages. Each override is `key.path=value`, the
/// value in TOML, or a bare word for a string; it replaces what the text says. Keys and defaults: docs/scenario.md.
/// Throws InputError with a message `name:line: key: expected …, got …`, or `--set key.path=value: key: …`.
AnyScenario parse_scenario(std::string_view text, std::string_view name, std::span<const std::string> overrides = {});

/// The same from a file, "-" being standard input; a file that cannot be read is an InputError too.
AnyScenario read_scenario(const std::filesystem::path& file, std::span<const std::string> overrides = {});

}  // namespace pendula::io
