#pragma once

#include <toml++/toml.h>
#include <cstdint>
#include <string>
#include <string_view>

namespace pendula::io {

/// How the place of an override begins.
inline constexpr std::string_view override_prefix = "--set ";

/// The beginning of a message: `file:line`, or `--set key=value`.
std::string line_place(const std::string& name, std::int64_t line);

/// The same for a node of TOML.
std::string location(const toml::source_region& source);

/// Cuts a text that is too long for a message, between UTF-8 characters.
std::string cut(std::string_view text);

/// A text on one line, cut if it is long.
std::string printable(std::string_view text);

std::string toml_string(std::string_view text);

/// A value as messages show it: one line, cut if it is long.
std::string shown(const toml::node& node);

}  // namespace pendula::io
