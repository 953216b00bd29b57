#pragma once

#include <span>
#include <string>
#include <string_view>

namespace pendula::cli {

struct CommandLine;

/// `pendula completion --words WORD...` is how the scripts of shells ask.
inline constexpr std::string_view candidates_flag = "--words";

/// What the last of the words behind `pendula` may become: a line each, with a tab and what it is where there is more
/// to say; or `:files` and the endings of files that may stand there.
std::string candidates(const CommandLine& line, std::span<const std::string> words);

/// A script for bash, zsh or fish, which asks the program itself for candidates.
std::string completion_script(std::string_view shell);

}  // namespace pendula::cli
