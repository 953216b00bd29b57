#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <pendula/system/system_table.hpp>
#include <string>
#include <string_view>

#include "io/errors.hpp"
#include "io/model_name.hpp"
#include "io/toolchain.hpp"

namespace pendula::io {

/// The kernel of a model.
struct ModelKernel {
  std::filesystem::path file;  ///< empty if it is part of this program
  std::shared_ptr<const SystemTable> table;
  bool was_there = true;  ///< false if it was made just now

  /// How its functions run: "build" if it is part of this program, else "compiler", "llvm" or "interpreter".
  std::string_view by() const;
};

/// Finds the kernel of a model in this build or in the cache, or makes it. tell(what) is called before anything takes
/// long. Throws ModelError if the model is wrong, or something is missing to make it.
ModelKernel find_kernel(const ModelName& model, const Toolchain& toolchain,
                        const std::function<void(const std::string&)>& tell);

/// The program by which an interpreter runs the kernel of a model, from the cache or made now. Throws ModelError.
std::string kernel_program(const ModelName& model, Toolchain toolchain,
                           const std::function<void(const std::string&)>& tell);

/// The text of a model's file; empty if its kernel is part of this program. Throws as find_kernel.
std::string model_source(const ModelName& name, const Toolchain& toolchain);

}  // namespace pendula::io
