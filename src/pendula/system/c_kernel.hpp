#pragma once

#include <memory>
#include <pendula/system/system_table.hpp>

namespace pendula {

/// A kernel compiled from C, as a shared object exports it under the name pendula_kernel
/// (pendula_codegen/templates/kernel.c.j2).
struct CKernel {
  int interface;                        ///< system_interface
  const char* description;              ///< for KernelDescription
  const SystemFunctions* functions[4];  ///< of 1, 2, 4 and 8 states
  const PlainFunctions* plain;
};
static_assert(std::is_trivially_copyable_v<CKernel> && std::is_standard_layout_v<CKernel>);

/// The table of `kernel`. It shares ownership of `object`, the loaded library that everything in `kernel` points into.
/// Throws std::invalid_argument for another interface version or an invalid description.
std::shared_ptr<const SystemTable> table_of(const CKernel& kernel, std::shared_ptr<const void> object);

}  // namespace pendula
