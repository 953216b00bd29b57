#pragma once

#include <span>
#include <string>
#include <string_view>

namespace pendula::cli {

struct CommandLine;

/// `pendula completion --words WORD...` is how the scripts of shells ask.
inline constexpr std::string_view candidates_flag = "--words";

/// Candidates for the last of the words after `pendula`, a line each, some with a tab and a description; or `:files`
/// and the endings of files.
std::string candidates(const CommandLine& line, std::span<const std::string> words);

/// A script for bash, zsh or fish that asks the program for candidates.
std::string completion_script(std::string_view shell);

}  // namespace pendula::cli
