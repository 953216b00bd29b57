#pragma once

#include <filesystem>
#include <memory>
#include <pendula/system/system_table.hpp>
#include <string>

#include "io/toolchain.hpp"

/// Files of kernels. They end in a hash, so that a damaged kernel is not run.
namespace pendula::io {

/// Extensions of their names: a shared object, an object file by LLVM, or a program for the interpreter.
inline constexpr const char *compiled_kernel = ".so", *llvm_kernel = ".o", *interpreted_kernel = ".program";

/// Appends the hash, and lets nobody but the owner write. Throws ModelError if the file cannot be written.
void seal_kernel(const std::filesystem::path& file);

/// The program of an interpreted kernel in its file, without the seal. Throws ModelError.
std::string program_in(const std::filesystem::path& kept);

/// Loads a kernel. Returns null where there is no file; and null, and says why in `problem`, unless the file is
/// complete, the user's own, closed to what others may write, and of this version.
std::shared_ptr<const SystemTable> load_kernel(const std::filesystem::path& kept, const Toolchain& toolchain,
                                               std::string& problem);

/// Removes kernels that were not used for 90 days: each version of a model and of pendula has its own.
void remove_unused_kernels(const std::filesystem::path& folder);

}  // namespace pendula::io
