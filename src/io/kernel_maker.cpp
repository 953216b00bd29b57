#include "io/kernel_maker.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <initializer_list>
#include <iterator>
#include <pendula/run/library.hpp>
#include <thread>

#include "io/errors.hpp"
#include "io/generator.hpp"
#include "io/kernel_file.hpp"
#include "io/process.hpp"

namespace pendula::io {

namespace fs = std::filesystem;

namespace {

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
  for (const std::string& flag : architecture_flags(library().instruction_set)) compiler.push_back(flag);
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
  if (is_llvm) arguments.insert(arguments.end(), {"--for", std::string(library().instruction_set)});
  run_generator(arguments, toolchain);
  derived();
  if (is_c) return compile(name, text, toolchain);
  return is_llvm ? compile_by_llvm(name, text, toolchain) : text;
}

}  // namespace pendula::io
