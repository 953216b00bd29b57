#pragma once

#include <toml++/toml.h>
#include <cstdint>
#include <string>
#include <string_view>

namespace pendula::io {

/// What the place of an override begins with, in messages and as the source of its value.
inline constexpr std::string_view override_prefix = "--set ";

/// Where a line of `name` is, as messages begin: `file:line`, or `--set key=value`.
std::string line_place(const std::string& name, std::int64_t line);

/// The same of what was read.
std::string location(const toml::source_region& source);

/// The beginning of a text that is too long for a message, and never half a character of it.
std::string cut(std::string_view text);

/// A text on one line, cut where it is long.
std::string printable(std::string_view text);

std::string toml_string(std::string_view text);

/// A value as messages show it: one line, cut where it is long.
std::string shown(const toml::node& node);

}  // namespace pendula::io
