#pragma once

#include <span>
#include <string>
#include <string_view>

namespace pendula::io {

/// The candidate nearest to `name`, for "did you mean …?". It needs few insertions, deletions, replacements and swaps
/// of neighbours, about one in three letters. If there is none, a candidate that begins with `name`; else empty.
std::string_view nearest_name(std::string_view name, std::span<const std::string_view> candidates);

/// `" (did you mean NAME?)"`; empty for an empty name.
std::string did_you_mean(std::string_view name);

}  // namespace pendula::io
