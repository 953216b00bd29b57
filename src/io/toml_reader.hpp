#pragma once

#include <toml++/toml.h>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace pendula::io {

/// The text of a scenario, and the name of its file in messages.
struct ScenarioText {
  std::string name, text;
};

/// Reads a file, "-" being standard input. Throws InputError where it cannot be read.
ScenarioText read_scenario_text(const std::filesystem::path& file);

/// Parses TOML text and applies overrides `key.path=value`. Every node knows its place: `name` and a line, or the text
/// of the override. Throws InputError if the text is not TOML, or an override cannot be applied.
toml::table parse_toml(std::string_view text, std::string_view name, std::span<const std::string> overrides);

/// Applies one override. Throws InputError.
void apply_override(toml::table& root, const std::string& text);

/// Sets one key to a number, as an override does. For the many copies of a document: their nodes have no places.
void set_number(toml::table& root, std::string_view key, double number);

}  // namespace pendula::io
