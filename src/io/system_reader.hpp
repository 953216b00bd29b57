#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "io/scenario.hpp"
#include "io/section.hpp"

namespace pendula::io {

/// A warning for an angle of [start], or an array of angles, that is a short plain number beyond one turn: it was
/// probably meant in degrees.
std::optional<std::string> warning_of_degrees(const Entry& entry);

/// Reads the tables [system] and [start] of the document `root`. Throws InputError.
SystemScenario read_system(const Section& root, const std::filesystem::path& folder, const FindSystem& find);

}  // namespace pendula::io
