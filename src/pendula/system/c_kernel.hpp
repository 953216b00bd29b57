#pragma once

#include <memory>
#include <pendula/system/system_table.hpp>

namespace pendula {

/// A kernel in C, as a shared object has it under the name of pendula_kernel (pendula_codegen/templates/kernel.c.j2).
struct CKernel {
  int interface;                        ///< system_interface
  const char* description;              ///< for KernelDescription
  const SystemFunctions* functions[4];  ///< of 1, 2, 4 and 8 states
  const PlainFunctions* plain;
};
static_assert(std::is_trivially_copyable_v<CKernel> && std::is_standard_layout_v<CKernel>);

/// Its table, which keeps `object`, where all of that lies. Throws std::invalid_argument where it is of another
/// interface, or its description is none.
std::shared_ptr<const SystemTable> table_of(const CKernel& kernel, std::shared_ptr<const void> object);

}  // namespace pendula
