#include "io/toolchain.hpp"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <system_error>

#include "installed_folders.hpp"

namespace pendula::io {

namespace fs = std::filesystem;

namespace {

std::string environment(const char* name, const std::string& otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr || *value == '\0' ? otherwise : std::string(value);
}

/// The folder of caches; empty if the environment names none. As XDG says, relative paths are ignored: they would
/// depend on the working folder.
fs::path cache_folder() {
  const fs::path kept = environment("XDG_CACHE_HOME", ""), home = environment("HOME", "");
  if (kept.is_absolute()) return kept / "pendula";
  return home.is_absolute() ? home / ".cache" / "pendula" : fs::path();
}

/// The first of the usual C compilers in PATH; empty if there is none.
std::string find_compiler() {
  const std::string path = environment("PATH", "");
  for (const char* name : {"cc", "gcc", "clang"}) {
    std::istringstream folders(path);
    for (std::string folder; std::getline(folders, folder, ':');) {
      const fs::path file = fs::path(folder) / name;
      if (file.is_absolute() && access(file.c_str(), X_OK) == 0) return file.string();
    }
  }
  return "";
}

}  // namespace

fs::path this_program() {
  std::error_code none;
  return fs::read_symlink("/proc/self/exe", none);
}

Toolchain Toolchain::of_this_program() {
  return of(this_program().parent_path());
}

Toolchain Toolchain::of(const fs::path& folder) {
  Toolchain toolchain;
  const fs::path prefix = folder.parent_path();
  // In the build folder this file has lines with the Python, and the folders of generator, plots and scenarios,
  // the static library and the folder of headers.
  std::ifstream beside(folder / "pendula.toolchain");
  if (beside) {
    std::string line;
    std::getline(beside, toolchain.python);
    for (fs::path* package :
         {&toolchain.codegen, &toolchain.plotting, &toolchain.examples, &toolchain.library, &toolchain.headers}) {
      if (std::getline(beside, line)) *package = line;
    }
  } else {
    const fs::path own = prefix / configured::installed_python;  // made by setup()
    toolchain.python = fs::exists(own) ? own.string() : "python3";
    toolchain.codegen = prefix / configured::installed_codegen;
    toolchain.plotting = prefix / configured::installed_plotting;
    toolchain.examples = prefix / configured::installed_examples;
    toolchain.library = prefix / configured::installed_library;
    toolchain.headers = prefix / configured::installed_headers;
  }
  toolchain.python = environment("PENDULA_PYTHON", toolchain.python);
  toolchain.compiler = environment("CC", find_compiler());
  toolchain.kernels_by = environment("PENDULA_KERNELS_BY", "auto");
  std::istringstream flags(environment("CFLAGS", ""));
  for (std::string flag; flags >> flag;) toolchain.flags.push_back(flag);
  toolchain.cache = cache_folder();
  return toolchain;
}

// Python looks for modules in the working folder first, and in PYTHONPATH (-E switches that off): a foreign sympy.py
// would run. The flag `-P` for that needs Python 3.11.
std::vector<std::string> Toolchain::module(const fs::path& folder, const std::string& name) const {
  constexpr const char* start =
      "import sys; sys.path[:] = [sys.argv[1], *filter(None, sys.path)]; name = sys.argv[2]; del sys.argv[1:3]; "
      "import runpy; runpy.run_module(name, run_name='__main__', alter_sys=True)";
  return {python, "-E", "-B", "-c", start, folder.string(), name};
}

fs::path Toolchain::setup() const {
  const fs::path root = codegen.parent_path();
  return fs::exists(root / "setup") ? root / "setup" : root / "scripts" / "setup";
}

}  // namespace pendula::io
