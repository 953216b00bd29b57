#pragma once

#include <string>

#include "io/toolchain.hpp"

namespace pendula::python {

/// What goes with the Python package: `program` is where its program is, `python` runs the generator, where that does
/// not run in this process (python/pendula/_generator.py). Kernels may be made by LLVM (python/pendula/_jit.py).
io::Toolchain toolchain_of(const std::string& program, const std::string& python);

}  // namespace pendula::python
