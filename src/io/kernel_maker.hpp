#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "io/toolchain.hpp"

/// Makes kernels of models: the generator derives them, and a compiler or LLVM compiles them, or they are interpreted.
/// Failures throw ModelError.
namespace pendula::io {

/// The extension of kernels that are made here, as the environment asks. Fails if it asks for something unknown.
const char* kind_of_kernels(const Toolchain& toolchain);

/// Compiler flags for code that runs on every processor that this build does.
std::vector<std::string> flags_of_least_set();

/// A description of such kernels.
std::string how_made(std::string_view kind, const Toolchain& toolchain);

/// Makes a kernel in `folder` by the generator with these arguments; calls derived() once that is done. Returns its
/// file.
std::filesystem::path make_kernel(std::string_view kind, const std::string& name, std::vector<std::string> arguments,
                                  const std::filesystem::path& folder, const Toolchain& toolchain,
                                  const std::function<void()>& derived);

}  // namespace pendula::io
