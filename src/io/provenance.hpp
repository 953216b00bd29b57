#pragma once

#include <span>
#include <string>

namespace pendula::io {

/// The public name of a file: an absolute path without its folders.
std::string public_name(const std::string& file);

/// Replaces `file` in a text by its public name.
std::string with_public_name(std::string text, const std::string& file);

/// A command line as typed, quoted for a shell; files have their public names.
std::string command_line(std::span<char* const> words);

/// A line of the CF attribute `history`: the time and the command.
std::string history_line(const std::string& command);

}  // namespace pendula::io
