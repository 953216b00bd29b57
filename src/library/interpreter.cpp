#include "library/interpreter.hpp"

#include <pendula/system/interpreter.hpp>

namespace pendula {

constinit const ProgramInterpreter interpreter = program_interpreter;

}  // namespace pendula
