#pragma once

#include <string>

namespace pendula::cli {

struct CommandLine;

/// The manual page pendula(1), in the macros of man(7).
std::string manual_page(const CommandLine& line);

}  // namespace pendula::cli
