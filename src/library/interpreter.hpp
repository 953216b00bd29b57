#pragma once

#include <pendula/system/program.hpp>

namespace pendula {

/// Executes programs with this instruction set.
extern constinit const ProgramInterpreter interpreter;

}  // namespace pendula
