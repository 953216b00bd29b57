#pragma once

#include <string>
#include <vector>

#include "io/scenario.hpp"

namespace pendula::cli {

/// The scenario in a file, with some keys replaced, `key.path=value`. That a kernel is made is told, unless it is to be
/// quiet. Throws io::InputError.
io::AnyScenario read_scenario(const std::string& file, const std::vector<std::string>& overrides, bool quiet);

}  // namespace pendula::cli
