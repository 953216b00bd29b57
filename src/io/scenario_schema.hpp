#pragma once

#include <string>

namespace pendula::io {

/// What a scenario may hold, as a JSON Schema: for editors, and for the tests of docs/scenario.md.
std::string scenario_schema();

}  // namespace pendula::io
