#pragma once

#include <string>

namespace pendula::io {

/// The JSON Schema of scenarios, for editors and for the tests of docs/reference/scenario.md.
std::string scenario_schema();

}  // namespace pendula::io
