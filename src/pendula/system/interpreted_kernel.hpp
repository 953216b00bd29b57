#pragma once

#include <memory>
#include <pendula/system/program.hpp>
#include <pendula/system/system_table.hpp>
#include <string>

namespace pendula {

/// The table of an interpreted kernel. `text` is what `python -m pendula_codegen program --as bytecode` writes; it is
/// checked, since it may be damaged. Throws std::invalid_argument that names the offending line.
std::shared_ptr<const SystemTable> table_of(std::string text, const ProgramInterpreter& interpreter);

}  // namespace pendula
