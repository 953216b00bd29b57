#pragma once

#include <pendula/system/program.hpp>

namespace pendula {

/// Carries out programs by this instruction set.
extern constinit const ProgramInterpreter interpreter;

}  // namespace pendula
