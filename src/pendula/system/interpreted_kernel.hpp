#pragma once

#include <memory>
#include <pendula/system/program.hpp>
#include <pendula/system/system_table.hpp>
#include <string>

namespace pendula {

/// The table of a kernel that is interpreted: of the text that `python -m pendula_codegen program --as bytecode`
/// writes, which may be damaged. Throws std::invalid_argument with the line that is wrong.
std::shared_ptr<const SystemTable> table_of(std::string text, const ProgramInterpreter& interpreter);

}  // namespace pendula
