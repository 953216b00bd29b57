#include "io/kernel_cache.hpp"

#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <span>
#include <sstream>
#include <string_view>
#include <system_error>

#include "io/nearest_name.hpp"
#include "io/process.hpp"
#include "io/scenario.hpp"
#include "toolchain.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

std::string environment(const char* name, const std::string& otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr || *value == '\0' ? otherwise : std::string(value);
}

fs::path this_program() {
  std::error_code none;
  return fs::read_symlink("/proc/self/exe", none);
}

fs::path cache_folder() {
  const std::string kept = environment("XDG_CACHE_HOME", "");
  if (!kept.empty()) return fs::path(kept) / "pendula";
  const std::string home = environment("HOME", "");
  return (home.empty() ? fs::temp_directory_path() : fs::path(home) / ".cache") / "pendula";
}

/// FNV-1a, of whatever decides what a compiled kernel is.
class Key {
 public:
  Key& add(std::string_view text) {
    for (const char byte : text) hash_ = (hash_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
    hash_ = (hash_ ^ 0x1ffU) * 0x100000001b3U;  // an end that no text has
    return *this;
  }
  /// Size and time of a file.
  Key& add_file(const fs::path& file) {
    std::error_code none;
    const auto time = fs::last_write_time(file, none).time_since_epoch().count();
    return add(file.string()).add(std::to_string(fs::file_size(file, none))).add(std::to_string(time));
  }
  std::string text() const {
    constexpr std::string_view digits = "0123456789abcdef";
    std::string text;
    for (int shift = 60; shift >= 0; shift -= 4) text += digits[(hash_ >> shift) & 15];
    return text;
  }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325U;
};

std::string read_model(const fs::path& file) {
  if (fs::is_directory(file)) throw ModelError("expected a model file, got the folder " + file.string());
  std::ifstream stream(file, std::ios::binary);
  if (!stream)
    throw ModelError("expected a model file that can be read, got " + file.string() + ": " + std::strerror(errno));
  return {std::istreambuf_iterator<char>(stream), {}};
}

fs::path models_folder(const Toolchain& toolchain) {
  return toolchain.codegen / "pendula_codegen" / "models";
}

fs::path find_model(const std::string& model, const fs::path& folder, const Toolchain& toolchain) {
  if (model.ends_with(".py")) return fs::path(model).is_absolute() ? fs::path(model) : folder / model;
  const std::vector<std::string> names = built_in_models(toolchain);
  if (std::ranges::find(names, model) != names.end()) return models_folder(toolchain) / (model + ".py");
  std::string text;
  for (const std::string& name : names) text += ", " + name;
  throw ModelError("expected a model file ending in .py, or a built-in model" +
                   (names.empty() ? " (none are installed)" : ": " + text.substr(2)) + "; got " + model +
                   did_you_mean(nearest_name(model, std::vector<std::string_view>(names.begin(), names.end()))));
}

/// Flags for the instruction set that the library runs with, as in cmake/PendulaLibrary.cmake.
std::vector<std::string> architecture_flags() {
  const std::string_view set = library().instruction_set;
  if (set == "sse2") return {"-march=x86-64", "-mno-sse3"};
  if (set == "avx2") return {"-march=x86-64", "-mavx2", "-mfma"};
  if (set == "avx512") {
    return {"-march=x86-64", "-mavx2", "-mfma", "-mavx512f", "-mavx512cd", "-mavx512dq", "-mavx512bw", "-mavx512vl"};
  }
  return {};
}

/// A folder that is gone when it is done with.
class Workshop {
 public:
  explicit Workshop(const fs::path& parent) {
    std::error_code error;
    fs::create_directories(parent, error);
    std::string name = (parent / "making-XXXXXX").string();
    if (error || mkdtemp(name.data()) == nullptr) {
      throw ModelError("expected to write compiled kernels to " + parent.string() + ", got: " +
                       (error ? error.message() : std::strerror(errno)) + " (XDG_CACHE_HOME names another folder)");
    }
    folder_ = name;
  }
  Workshop(const Workshop&) = delete;
  Workshop& operator=(const Workshop&) = delete;
  ~Workshop() {
    std::error_code none;
    fs::remove_all(folder_, none);
  }
  const fs::path& folder() const { return folder_; }

 private:
  fs::path folder_;
};

std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of('\n');
  if (end == std::string::npos) return "";
  const std::size_t begin = text.find_last_of('\n', end);
  return text.substr(begin == std::string::npos ? 0 : begin + 1,
                     end - (begin == std::string::npos ? 0 : begin + 1) + 1);
}

/// What the generator prints. Throws ModelError, also where no Python can run it.
std::string run_generator(const std::vector<std::string>& arguments, const Toolchain& toolchain) {
  std::vector<std::string> command{toolchain.python, "-m", "pendula_codegen"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const Ended ended = run_process(command, {"PYTHONPATH=" + toolchain.codegen.string(), "PYTHONDONTWRITEBYTECODE=1"});
  if (ended.status == 0) return ended.output;
  constexpr std::string_view told = "pendula_codegen: error: ";
  const std::string line = last_line(ended.output);
  if (ended.status == 2 && line.starts_with(told)) throw ModelError(line.substr(told.size()));
  throw ModelError("models take a Python with the packages of " + (toolchain.codegen / "requirements.txt").string() +
                   ", which " + toolchain.setup().string() + " installs; " + toolchain.python + ": " + line +
                   " (PENDULA_PYTHON names another one)");
}

/// The arguments of a command of the generator that is about a model.
std::vector<std::string> about(const char* command, const fs::path& model, std::optional<int> links) {
  std::vector<std::string> arguments{command, "--model", model.string()};
  if (links) arguments.insert(arguments.end(), {"--links", std::to_string(*links)});
  return arguments;
}

void derive(const fs::path& model, std::optional<int> links, const fs::path& header, const Toolchain& toolchain) {
  std::vector<std::string> arguments = about("model", model, links);
  arguments.insert(arguments.end(), {"--output", header.string()});
  run_generator(arguments, toolchain);
}

void compile(const std::string& name, const fs::path& folder, const fs::path& object, const Toolchain& toolchain) {
  const fs::path source = folder / "kernel.cpp";
  std::ofstream(source) << "#include \"" << name << ".hpp\"\n"
                        << "#include <pendula/run/system_entry.hpp>\n"
                        << "#define EXPORTED extern \"C\" __attribute__((visibility(\"default\")))\n"
                        << "EXPORTED constinit const int pendula_interface = pendula::system_interface;\n"
                        << "EXPORTED constinit const pendula::SystemEntry pendula_system =\n"
                        << "    pendula::system_entry<pendula::kernels::" << name << "_kernel>();\n";
  std::vector<std::string> command{toolchain.compiler,
                                   "-std=c++20",
                                   "-O3",
                                   "-DNDEBUG",
                                   "-w",
                                   "-fPIC",
                                   "-shared",
                                   "-fvisibility=hidden",
                                   "-fvisibility-inlines-hidden",
                                   "-Wl,-Bsymbolic"};
  for (const std::string& flag : architecture_flags()) command.push_back(flag);
  for (const std::string& flag : toolchain.flags) command.push_back(flag);
  for (const fs::path& include : toolchain.includes) command.push_back("-I" + include.string());
  command.insert(command.end(), {source.string(), "-o", object.string()});
  const Ended ended = run_process(command);
  if (ended.status == 0) return;
  std::string error = ended.output.substr(0, ended.output.find('\n', ended.output.find("error")));
  if (ended.status == 127) {
    throw ModelError("models take a C++20 compiler; " + toolchain.compiler + ": " + ended.output +
                     " (CXX names another one)");
  }
  throw ModelError("the compiler " + toolchain.compiler + " refuses the kernel of " + name + ": " + last_line(error));
}

std::shared_ptr<const SystemEntry> load(const fs::path& object) {
  void* handle = dlopen(object.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw ModelError("the kernel " + object.string() + " cannot be loaded: " + dlerror());
  const auto* interface = static_cast<const int*>(dlsym(handle, "pendula_interface"));
  const auto* entry = static_cast<const SystemEntry*>(dlsym(handle, "pendula_system"));
  if (interface == nullptr || entry == nullptr || *interface != system_interface) {
    dlclose(handle);
    throw ModelError("the kernel " + object.string() + " is of another pendula; remove it to have it made again");
  }
  return {entry, [handle](const SystemEntry*) { dlclose(handle); }};
}

/// Removes kernels that no run has taken for a quarter of a year: each version of a model and of pendula has its own.
void remove_unused_kernels(const fs::path& cache) {
  const auto oldest = fs::file_time_type::clock::now() - std::chrono::days(90);
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(cache, none)) {
    const fs::file_time_type used = entry.last_write_time(none);
    if (!none && entry.path().extension() == ".so" && used < oldest) fs::remove(entry.path(), none);
  }
}

/// Numbers with commas between them.
template <class Numbers>
std::string listed(const Numbers& numbers) {
  std::string text;
  for (const double number : numbers) {
    if (!text.empty()) text += ',';
    text += shortest(number);
  }
  return text;
}

std::string kernel_name(const std::string& model, std::optional<int> links) {
  const std::string stem = fs::path(model).stem().string();
  return links ? stem + "_" + std::to_string(*links) : stem;
}

/// The kernel of a built-in model, where this program has it.
const SystemEntry* built_in_entry(const std::string& model, std::optional<int> links) {
  if (model.ends_with(".py")) return nullptr;
  for (const SystemEntry* entry : library().systems) {
    if (entry->info.name == kernel_name(model, links)) return entry;
  }
  return nullptr;
}

}  // namespace

Toolchain Toolchain::of_this_program() {
  Toolchain toolchain;
  const fs::path folder = this_program().parent_path(), prefix = folder.parent_path();
  // Of a program in its build folder: a Python, the generator, the plots, scenarios, folders of headers, a line each.
  std::ifstream beside(folder / "pendula.toolchain");
  if (beside) {
    std::string line;
    std::getline(beside, toolchain.python);
    for (fs::path* package : {&toolchain.codegen, &toolchain.plotting, &toolchain.examples}) {
      if (std::getline(beside, line)) *package = line;
    }
    while (std::getline(beside, line)) toolchain.includes.emplace_back(line);
  } else {
    const fs::path own = prefix / configured::installed_python;  // made by setup()
    toolchain.python = fs::exists(own) ? own.string() : "python3";
    toolchain.codegen = prefix / configured::installed_codegen;
    toolchain.plotting = prefix / configured::installed_plotting;
    toolchain.examples = prefix / configured::installed_examples;
    toolchain.includes.push_back(prefix / configured::installed_include);
  }
  for (const char* include : configured::includes) toolchain.includes.emplace_back(include);
  toolchain.python = environment("PENDULA_PYTHON", toolchain.python);
  toolchain.compiler = environment("CXX", configured::compiler);
  std::istringstream flags(environment("CXXFLAGS", ""));
  for (std::string flag; flags >> flag;) toolchain.flags.push_back(flag);
  toolchain.cache = cache_folder();
  return toolchain;
}

fs::path Toolchain::setup() const {
  const fs::path root = codegen.parent_path();
  return fs::exists(root / "setup") ? root / "setup" : root / "scripts" / "setup";
}

std::vector<std::string> built_in_models(const Toolchain& toolchain) {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(models_folder(toolchain), none)) {
    if (entry.path().extension() == ".py" && entry.path().stem() != "__init__") names.push_back(entry.path().stem());
  }
  std::ranges::sort(names);
  return names;
}

std::string describe_model(const std::string& model, std::optional<int> links, const Toolchain& toolchain) {
  const fs::path file = find_model(model, "", toolchain);
  read_model(file);
  return last_line(run_generator(about("describe", file, links), toolchain));
}

std::string describe_models(const Toolchain& toolchain) {
  return last_line(run_generator({"models"}, toolchain));
}

std::string model_source(const std::string& model, std::optional<int> links, const fs::path& folder,
                         const Toolchain& toolchain) {
  return built_in_entry(model, links) ? "" : read_model(find_model(model, folder, toolchain));
}

ModelKernel find_kernel(const std::string& model, std::optional<int> links, const fs::path& folder,
                        const Toolchain& toolchain, const std::function<void(const std::string&)>& tell) {
  if (const SystemEntry* entry = built_in_entry(model, links)) return {{}, {entry, [](const SystemEntry*) {}}};
  const std::string name = kernel_name(model, links);
  const fs::path file = find_model(model, folder, toolchain);
  Key key;
  key.add(read_model(file)).add(name).add(version).add(library().instruction_set);
  key.add(toolchain.python).add(toolchain.compiler).add_file(this_program());
  for (const std::string& flag : toolchain.flags) key.add(flag);
  std::error_code none;
  for (const auto& part : fs::recursive_directory_iterator(toolchain.codegen / "pendula_codegen", none)) {
    if (part.path().extension() == ".py" || part.path().extension() == ".j2") key.add_file(part.path());
  }
  const fs::path object = toolchain.cache / (name + "-" + key.text() + ".so");
  const bool was_there = fs::exists(object);
  if (was_there) {
    fs::last_write_time(object, fs::file_time_type::clock::now(), none);  // used again
  } else {
    const Workshop workshop(toolchain.cache);
    tell("deriving and compiling the kernel of " + name + ", once");
    derive(file, links, workshop.folder() / (name + ".hpp"), toolchain);
    compile(name, workshop.folder(), workshop.folder() / "kernel.so", toolchain);
    fs::rename(workshop.folder() / "kernel.so", object);
  }
  remove_unused_kernels(toolchain.cache);
  return {object, load(object), was_there};
}

std::vector<double> written_values(const std::string& model, std::optional<int> links, const fs::path& folder,
                                   const Toolchain& toolchain, std::span<const double> parameters, const Motion& start,
                                   unsigned seed) {
  std::vector<std::string> arguments = about("written", find_model(model, folder, toolchain), links);
  const auto add = [&](const char* name, const std::string& value) { arguments.push_back(name + ('=' + value)); };
  add("--parameters", listed(parameters));
  add("--time", shortest(start.time));
  add("--q", listed(start.q));
  add("--v", listed(start.v));
  add("--seed", std::to_string(seed));
  std::istringstream words(last_line(run_generator(arguments, toolchain)));
  std::vector<double> numbers;
  for (std::string word; words >> word;) numbers.push_back(std::strtod(word.c_str(), nullptr));
  return numbers;
}

}  // namespace pendula::io
