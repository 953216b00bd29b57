#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <pendula/system/system_table.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "io/toolchain.hpp"

/// Files of kernels of models: the generator derives them, and a compiler or LLVM compiles them, or they are
/// interpreted. They end in a hash, so that a damaged kernel is not run. Failures throw ModelError.
namespace pendula::io {

/// Extensions of their names: a shared object, an object file by LLVM, or a program for the interpreter.
inline constexpr const char *compiled_kernel = ".so", *llvm_kernel = ".o", *interpreted_kernel = ".program";

/// The extension of kernels that are made here, as the environment asks. Fails if it asks for something unknown.
const char* kind_of_kernels(const Toolchain& toolchain);

/// Compiler flags for the smallest instruction set of this build.
std::vector<std::string> flags_of_least_set();

/// A description of such kernels.
std::string how_made(std::string_view kind, const Toolchain& toolchain);

/// Makes a kernel in `folder` by the generator with these arguments; calls derived() once that is done. Returns its
/// file.
std::filesystem::path make_kernel(std::string_view kind, const std::string& name, std::vector<std::string> arguments,
                                  const std::filesystem::path& folder, const Toolchain& toolchain,
                                  const std::function<void()>& derived);

/// Appends the hash, and lets nobody but the owner write. Throws ModelError if the file cannot be written.
void seal_kernel(const std::filesystem::path& file);

/// The program of an interpreted kernel in its file, without the seal. Throws ModelError.
std::string program_in(const std::filesystem::path& kept);

/// Loads a kernel. Returns null if there is no file. Returns null, with the reason in `problem`, unless the file is
/// complete and of this version, belongs to the user, and nobody else may write it.
std::shared_ptr<const SystemTable> load_kernel(const std::filesystem::path& kept, const Toolchain& toolchain,
                                               std::string& problem);

/// Removes kernels that were not used for 90 days: each version of a model and of pendula has its own.
void remove_unused_kernels(const std::filesystem::path& folder);

}  // namespace pendula::io
