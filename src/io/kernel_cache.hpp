#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <pendula/system/motion.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/input_error.hpp"

namespace pendula::io {

/// What it takes to make a kernel of a model and where it is kept, and what else runs in Python.
struct Toolchain {
  std::string python;              ///< with the packages of the generator
  std::string compiler;            ///< of C; empty where there is none
  std::string kernels_by;          ///< "compiler", "interpreter", or "auto": by a compiler where there is one
  std::vector<std::string> flags;  ///< of the user, after those that kernels are compiled with
  std::filesystem::path codegen;   ///< folder of the Python package pendula_codegen
  std::filesystem::path plotting;  ///< folder of the Python package pendula_plot
  std::filesystem::path examples;  ///< folder of the scenarios that come with pendula
  std::filesystem::path cache;     ///< folder of kernels; empty where none is named

  /// That of this program: of its build, told by the file pendula.toolchain beside it, or of where it is installed;
  /// PENDULA_PYTHON in the environment goes before. The compiler is that which CC names, else cc, gcc or clang, and
  /// CFLAGS has the flags; PENDULA_KERNELS_BY says what kernels are run by. The cache is $XDG_CACHE_HOME/pendula, else
  /// ~/.cache/pendula.
  static Toolchain of_this_program();

  /// The command line that runs a Python package of `folder`, and nothing out of the working folder or PYTHONPATH.
  std::vector<std::string> module(const std::filesystem::path& folder, const std::string& name) const;
  /// The command that installs the Python packages.
  std::filesystem::path setup() const;
};

/// The kernel of a model, compiled or interpreted.
struct ModelKernel {
  std::filesystem::path file;  ///< empty where it is part of this program
  std::shared_ptr<const SystemTable> table;
  bool was_there = true;  ///< not made just now

  /// What its functions come from: "build" where it is part of this program, else "compiler" or "interpreter".
  std::string_view by() const;
};

/// Finds the kernel of a model: one of this build, one kept, or one derived now, and compiled or not. `model` is a file
/// ending in .py, relative to `folder`, or the name of a built-in model; tell(what) is called before anything takes
/// long. Throws ModelError where the model is wrong or something is missing that it takes.
ModelKernel find_kernel(const std::string& model, std::optional<int> links, const std::filesystem::path& folder,
                        const Toolchain& toolchain, const std::function<void(const std::string&)>& tell);

/// The text of a model's file; empty where its kernel is part of this program. Throws as find_kernel.
std::string model_source(const std::string& model, std::optional<int> links, const std::filesystem::path& folder,
                         const Toolchain& toolchain);

/// What a model says about a start, for KernelComparison: by the generator, which derives it from the text of the
/// model. `parameters` are those of the kernel. Throws as find_kernel.
std::vector<double> written_values(const std::string& model, std::optional<int> links,
                                   const std::filesystem::path& folder, const Toolchain& toolchain,
                                   std::span<const double> parameters, const Motion& start, unsigned seed);

/// What a model has, as JSON: coordinates, parameters, inputs, points, with units. Throws ModelError.
std::string describe_model(const std::string& model, std::optional<int> links, const Toolchain& toolchain);

/// An array of the same of all built-in models.
std::string describe_models(const Toolchain& toolchain);

/// Names of the built-in models.
std::vector<std::string> built_in_models(const Toolchain& toolchain);

}  // namespace pendula::io
