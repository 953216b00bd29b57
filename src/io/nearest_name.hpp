#pragma once

#include <span>
#include <string>
#include <string_view>

namespace pendula::io {

/// The candidate most like `name`, for "did you mean …?"; empty where none is near enough to be meant.
///
/// Like means few insertions, deletions, replacements and swaps of neighbours: about one in three letters. Where there
/// is none, the one that begins with `name`.
std::string_view nearest_name(std::string_view name, std::span<const std::string_view> candidates);

/// `" (did you mean NAME?)"`; empty for an empty name.
std::string did_you_mean(std::string_view name);

}  // namespace pendula::io
