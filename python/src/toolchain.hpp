#pragma once

#include <string>

#include "io/toolchain.hpp"

namespace pendula::python {

/// What goes with the Python package: `program` is where its program is, `python` runs the generator, where that does
/// not run in this process (python/pendula/_generator.py).
io::Toolchain toolchain_of(const std::string& program, const std::string& python);

}  // namespace pendula::python
