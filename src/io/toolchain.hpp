#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/process.hpp"

namespace pendula {
struct CKernel;
}

namespace pendula::io {

/// LLVM in this process, where Python has it (python/pendula/_jit.py).
struct Llvm {
  std::function<bool()> is_there;
  /// Compiles a kernel's text to an object file. Returns what is wrong, if anything is.
  std::function<std::string(const std::filesystem::path& text, const std::filesystem::path& object)> compile;
  /// The kernel of an object file, which stays; throws std::invalid_argument if there is none.
  std::function<const CKernel*(std::string_view object)> load;
};

/// The programs and folders that pendula uses: Python, the C compiler, the Python packages, the cache of kernels.
struct Toolchain {
  std::string python;              ///< a Python with the packages of the generator
  std::string compiler;            ///< C compiler; empty if there is none
  std::string kernels_by;          ///< "compiler", "llvm", "interpreter", or "auto": the first that is there
  std::vector<std::string> flags;  ///< further compiler flags of the user
  std::filesystem::path codegen;   ///< folder of the Python package pendula_codegen
  std::filesystem::path plotting;  ///< folder of the Python package pendula_plot
  std::filesystem::path examples;  ///< folder of the scenarios that come with pendula
  std::filesystem::path library;   ///< the static library of pendula, which may not exist; empty if unknown
  std::filesystem::path headers;   ///< folder of pendula/pendula.h
  std::filesystem::path cache;     ///< folder of kernels; empty if there is none
  std::function<void()> ask;       ///< called, if given, while other programs run; if it throws, they are ended

  /// Runs the generator in this process, if given. Returns nullopt if `python` has to run it.
  std::function<std::optional<Ended>(const std::vector<std::string>& arguments)> generate;
  Llvm llvm;  ///< functions of the Python package; others have none

  bool has_llvm() const { return llvm.is_there && llvm.is_there(); }

  /// The toolchain of a program or Python package in `folder`: that of its build, if the file pendula.toolchain is
  /// there, else that of its installation. The environment comes first: PENDULA_PYTHON; CC, else cc, gcc or clang;
  /// CFLAGS; PENDULA_KERNELS_BY. The cache is $XDG_CACHE_HOME/pendula, else ~/.cache/pendula.
  static Toolchain of(const std::filesystem::path& folder);
  static Toolchain of_this_program();

  /// The command line that runs a Python package of `folder`; it imports nothing from the working folder or PYTHONPATH.
  std::vector<std::string> module(const std::filesystem::path& folder, const std::string& name) const;
  /// The command that installs the Python packages.
  std::filesystem::path setup() const;
};

/// The executable of this program.
std::filesystem::path this_program();

}  // namespace pendula::io
