#pragma once

#include <toml++/toml.h>
#include <span>
#include <string>
#include <string_view>

namespace pendula::io {

/// Reads TOML text and applies overrides `key.path=value`. Every node keeps where it came from: `name` and a line, or
/// the text of the override. Throws InputError on text that is no TOML and on overrides that fit nowhere.
toml::table parse_toml(std::string_view text, std::string_view name, std::span<const std::string> overrides);

/// The same as an override of one key by a number, without its text: for copies of documents, of which there are many,
/// and which have lost their places in the file.
void set_number(toml::table& root, std::string_view key, double number);

}  // namespace pendula::io
