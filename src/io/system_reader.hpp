#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "io/scenario.hpp"
#include "io/section.hpp"

namespace pendula::io {

/// What to say of an angle of [start], or of an array of them, that is given as a plain number of few digits and beyond
/// a turn: degrees, most likely.
std::optional<std::string> warning_of_degrees(const Entry& entry);

/// What the tables [system] and [start] say of a system that is no chain; `root` is the document. Throws InputError.
SystemScenario read_system(const Section& root, const std::filesystem::path& folder, const FindSystem& find);

}  // namespace pendula::io
