#include "io/kernel_file.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <future>
#include <initializer_list>
#include <iomanip>
#include <iterator>
#include <pendula/run/library.hpp>
#include <pendula/system/c_kernel.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/generator.hpp"
#include "io/process.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

/// Flags for an instruction set, as in cmake/PendulaLibrary.cmake.
std::vector<std::string> architecture_flags(std::string_view set) {
  if (set == "sse2") return {"-march=x86-64", "-mno-sse3"};
  if (set == "avx2") return {"-march=x86-64", "-mavx2", "-mfma"};
  if (set == "avx512") {
    return {"-march=x86-64", "-mavx2", "-mfma", "-mavx512f", "-mavx512cd", "-mavx512dq", "-mavx512bw", "-mavx512vl"};
  }
  return {};
}

constexpr const char* flags_of_kernels[] = {
    "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=fast", "-fno-math-errno", "-w"};

/// The first error of a compiler, in one line.
std::string first_error(const std::string& output) {
  return last_line(output.substr(0, output.find('\n', output.find("error"))));
}

/// Throws ModelError if a compiler has failed.
void require_compiled(const Ended& ended, const std::string& compiler, const std::string& name) {
  if (ended.status == 127) {
    throw ModelError("models take a C compiler; " + compiler + ": " + ended.output + " (CC names another one)");
  }
  if (ended.status != 0) {
    throw ModelError("the compiler " + compiler + " refuses the kernel of " + name + ": " + first_error(ended.output) +
                     " (PENDULA_KERNELS_BY=interpreter does without)");
  }
}

/// Runs compiler commands in parallel; only this thread calls ask(). Throws ModelError if one fails.
void run_compilers(const std::vector<std::vector<std::string>>& commands, const std::string& name,
                   const std::function<void()>& ask) {
  struct Stopped {};
  const auto stop_if = [](const std::atomic<bool>& stops) {
    if (stops) throw Stopped();
  };
  std::atomic<bool> stops = false;
  std::vector<std::future<Ended>> running(commands.size());
  std::ranges::transform(commands, running.begin(), [&](const std::vector<std::string>& command) {
    return std::async(std::launch::async, [&] { return run_process(command, [&] { stop_if(stops); }); });
  });
  for (std::future<Ended>& one : running) {
    try {
      while (one.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
        if (ask) ask();
      }
    } catch (...) {
      stops = true;
      throw;
    }
    require_compiled(one.get(), commands.front().front(), name);
  }
}

/// Compiles a kernel. Returns the shared object, beside the text.
fs::path compile(const std::string& name, const fs::path& text, const Toolchain& toolchain) {
  std::vector<std::string> compiler{toolchain.compiler};
  compiler.insert(compiler.end(), std::begin(flags_of_kernels), std::end(flags_of_kernels));
  for (const std::string& flag : architecture_flags(instruction_set())) compiler.push_back(flag);
  for (const std::string& flag : toolchain.flags) compiler.push_back(flag);
  const auto with = [&](std::initializer_list<std::string> more) {
    std::vector<std::string> command = compiler;
    command.insert(command.end(), more);
    return command;
  };
  // Functions of several widths are compiled in parallel.
  const unsigned processors = std::thread::hardware_concurrency();
  std::vector<int> shares{1 + 2 + 4 + 8};
  if (processors > 1) shares = {1 + 8, 2 + 4};
  if (processors > 3) shares = {1, 2, 4, 8};
  std::vector<std::vector<std::string>> commands;
  const fs::path made = fs::path(text).replace_extension(".so");
  std::vector<std::string> link = with({"-shared", "-o", made.string()});
  for (const int share : shares) {
    const std::string widths = std::to_string(share);
    const std::string object = fs::path(text).replace_extension(widths + ".o").string();
    commands.push_back(with({"-DWIDTHS=" + widths, "-c", text.string(), "-o", object}));
    link.push_back(object);
  }
  link.emplace_back("-lm");
  run_compilers(commands, name, toolchain.ask);
  run_compilers({link}, name, toolchain.ask);
  return made;
}

fs::path compile_by_llvm(const std::string& name, const fs::path& text, const Toolchain& toolchain) {
  const fs::path made = fs::path(text).replace_extension(llvm_kernel);
  const std::string problem = toolchain.llvm.compile(text, made);
  if (!problem.empty()) {
    throw ModelError("LLVM refuses the kernel of " + name + ": " + problem +
                     " (PENDULA_KERNELS_BY=interpreter does without)");
  }
  return made;
}

}  // namespace

std::vector<std::string> flags_of_least_set() {
  return architecture_flags(needed_instruction_set());
}

const char* kind_of_kernels(const Toolchain& toolchain) {
  const std::string& by = toolchain.kernels_by;
  const bool is_open = by == "auto";
  if (by == "compiler" && toolchain.compiler.empty()) {
    throw ModelError("models take a C compiler, got no cc, gcc or clang (CC names one)");
  }
  if (by == "compiler" || (is_open && !toolchain.compiler.empty())) return compiled_kernel;
  if (by == "llvm" && !toolchain.has_llvm()) {
    throw ModelError("PENDULA_KERNELS_BY: llvm is for Python with llvmlite (pip install 'pendula[jit]')");
  }
  if (by == "llvm" || (is_open && toolchain.has_llvm())) return llvm_kernel;
  if (by == "interpreter" || is_open) return interpreted_kernel;
  throw ModelError("PENDULA_KERNELS_BY: expected compiler, llvm, interpreter or auto, got " + by);
}

std::string how_made(std::string_view kind, const Toolchain& toolchain) {
  if (kind == compiled_kernel) return "compiled by " + toolchain.compiler;
  const std::string how = kind == llvm_kernel ? "compiled by LLVM" : "interpreted";
  return toolchain.kernels_by == "auto" ? how + ": no C compiler was found (CC names one)" : how;
}

fs::path make_kernel(std::string_view kind, const std::string& name, std::vector<std::string> arguments,
                     const fs::path& folder, const Toolchain& toolchain, const std::function<void()>& derived) {
  const bool is_c = kind == compiled_kernel, is_llvm = kind == llvm_kernel;
  const fs::path text = folder / (is_c ? "kernel.c" : is_llvm ? "kernel.ll" : "kernel.program");
  arguments.insert(arguments.end(), {"--as", is_c ? "c" : is_llvm ? "llvm" : "bytecode", "--output", text.string()});
  if (is_llvm) arguments.insert(arguments.end(), {"--for", std::string(instruction_set())});
  run_generator(arguments, toolchain);
  derived();
  if (is_c) return compile(name, text, toolchain);
  return is_llvm ? compile_by_llvm(name, text, toolchain) : text;
}

namespace {

constexpr std::size_t largest_kernel = std::size_t{256} << 20;

/// A hash of the file, appended to it; the loader of shared objects ignores what follows them.
std::string seal_of(std::string_view object) {
  std::ostringstream seal;
  seal << "pendula kernel " << std::hex << std::setw(16) << std::setfill('0') << fingerprint(object) << '\n';
  return seal.str();
}

/// Whether a file is complete: the disk may have been full, or the power lost.
bool is_sealed(std::string_view file) {
  const std::size_t size = seal_of({}).size();
  if (file.size() < size) return false;
  return file.substr(file.size() - size) == seal_of(file.substr(0, file.size() - size));
}

/// A path to an open file, a different one each time. The loader takes files of one name for the same object, and may
/// keep closed ones: with the path of the descriptor alone, a later kernel could turn out to be an earlier one.
std::string new_path(const Descriptor& file) {
  static std::atomic<std::uint64_t> paths = 0;
  std::string path = "/proc/self/fd";
  for (std::uint64_t rest = paths++; rest > 0; rest /= 2) path += rest % 2 == 0 ? "/." : "//.";
  return path + '/' + std::to_string(file.get());
}

/// A loaded shared object and its file.
struct Loaded {
  Descriptor file;
  void* handle = nullptr;

  explicit Loaded(Descriptor opened)
      : file(std::move(opened)), handle(dlopen(new_path(file).c_str(), RTLD_NOW | RTLD_LOCAL)) {}
  Loaded(const Loaded&) = delete;
  Loaded& operator=(const Loaded&) = delete;
  ~Loaded() {
    if (handle != nullptr) dlclose(handle);
  }
};

std::shared_ptr<const SystemTable> table_of_object(Descriptor file) {
  const auto loaded = std::make_shared<Loaded>(std::move(file));
  if (loaded->handle == nullptr) throw std::invalid_argument(dlerror());
  const auto* kernel = static_cast<const CKernel*>(dlsym(loaded->handle, "pendula_kernel"));
  if (kernel == nullptr) throw std::invalid_argument("it has no pendula_kernel");
  return table_of(*kernel, loaded);
}

}  // namespace

void seal_kernel(const fs::path& file) {
  const InputFile made = read_input_file(file, largest_kernel);
  std::ofstream stream(file, std::ios::binary | std::ios::app);
  stream << seal_of(made.text);
  stream.close();
  // Compilers and linkers leave the mode to the umask, which may let others write.
  std::error_code unchanged;
  fs::permissions(file, fs::perms::group_write | fs::perms::others_write, fs::perm_options::remove, unchanged);
  if (!made.problem.empty() || !stream || unchanged) {
    throw ModelError("expected to write the kernel " + file.string() + ", got: " +
                     (!made.problem.empty() ? made.problem
                      : unchanged           ? unchanged.message()
                                            : std::strerror(errno)));
  }
}

std::string program_in(const fs::path& kept) {
  InputFile file = read_input_file(kept, largest_kernel);
  if (!file.problem.empty() || !is_sealed(file.text)) {
    throw ModelError("expected the program of a kernel in " + kept.string() +
                     ", got: " + (file.problem.empty() ? "it is not what was written" : file.problem));
  }
  file.text.resize(file.text.size() - seal_of({}).size());
  return std::move(file.text);
}

std::shared_ptr<const SystemTable> load_kernel(const fs::path& kept, const Toolchain& toolchain, std::string& problem) {
  Descriptor opened(open(kept.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  struct stat status {};
  const auto none = [&](const std::string& why) -> std::shared_ptr<const SystemTable> {
    problem = kept.string() + ": " + why;
    return nullptr;
  };
  if (opened.get() < 0 && errno == ENOENT) return nullptr;
  if (opened.get() < 0 || fstat(opened.get(), &status) != 0) return none(std::strerror(errno));
  if (status.st_uid != geteuid() && status.st_uid != 0) return none("it belongs to somebody else");
  if (others_may_write(status)) return none("others may write to it");
  InputFile file = read_input_file("/proc/self/fd/" + std::to_string(opened.get()), largest_kernel);
  if (!file.problem.empty()) return none(file.problem);
  if (!is_sealed(file.text)) return none("it is not what was written");
  try {
    if (kept.extension() == compiled_kernel) return table_of_object(std::move(opened));
    file.text.resize(file.text.size() - seal_of({}).size());
    if (kept.extension() == llvm_kernel) return table_of(*toolchain.llvm.load(file.text), nullptr);
    return table_of(std::move(file.text), *library<const ProgramInterpreter*>());
  } catch (const std::invalid_argument& error) {
    return none(error.what());
  }
}

void remove_unused_kernels(const fs::path& folder) {
  const auto oldest = fs::file_time_type::clock::now() - std::chrono::days(90);
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    const fs::file_time_type used = entry.last_write_time(none);
    const fs::path kind = entry.path().extension();
    const bool is_kernel = kind == compiled_kernel || kind == llvm_kernel || kind == interpreted_kernel;
    if (!none && is_kernel && used < oldest) fs::remove(entry.path(), none);
  }
}

}  // namespace pendula::io
