#pragma once

#include <span>
#include <string>

namespace pendula::io {

/// A file as other people may be told of it: without its folders where they were given from the root on.
std::string public_name(const std::string& file);

/// A text in which `file` is named so.
std::string with_public_name(std::string text, const std::string& file);

/// A command line as it was typed, words quoted where a shell wants it; files by public names.
std::string command_line(std::span<char* const> words);

/// A line of the attribute `history`, as CF has it: the time, and the command.
std::string history_line(const std::string& command);

}  // namespace pendula::io
