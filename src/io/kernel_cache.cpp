#include "io/kernel_cache.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
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
#include <future>
#include <iomanip>
#include <iterator>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/library.hpp>
#include <pendula/system/c_kernel.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <pendula/version.hpp>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "io/descriptor.hpp"
#include "io/fingerprint.hpp"
#include "io/input_file.hpp"
#include "io/nearest_name.hpp"
#include "io/process.hpp"
#include "io/scenario.hpp"
#include "io/trusted_folder.hpp"
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

/// Empty where the environment names none. A path that is not absolute counts for nothing, as XDG has it: it would lead
/// into whatever folder the program is started in.
fs::path cache_folder() {
  const fs::path kept = environment("XDG_CACHE_HOME", ""), home = environment("HOME", "");
  if (kept.is_absolute()) return kept / "pendula";
  return home.is_absolute() ? home / ".cache" / "pendula" : fs::path();
}

/// The first of the usual C compilers that is in a folder of PATH; empty where none is.
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

/// Of whatever decides what a compiled kernel is.
class Key {
 public:
  Key& add(std::string_view text) {
    hash_ = fingerprint(std::to_string(text.size()) + ':', hash_);
    hash_ = fingerprint(text, hash_);
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
  std::uint64_t hash_ = empty_fingerprint;
};

std::string read_model(const fs::path& file) {
  constexpr std::size_t most = std::size_t{16} << 20;
  std::error_code unknown;
  InputFile read{{}, "neither a file nor a link to one"};  // Python reads it, too: no pipe
  if (fs::is_regular_file(file, unknown) || !fs::exists(file, unknown)) read = read_input_file(file, most);
  if (read.problem.empty()) return std::move(read.text);
  throw ModelError("expected a model file that can be read, got " + file.string() + ": " + read.problem);
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

/// Kernels are programs: the folder that they are kept in, if nobody else can put one there.
fs::path require_cache(const fs::path& folder) {
  const auto reject = [](const std::string& got) {
    throw ModelError("expected a folder of your own for compiled kernels, got " + got +
                     " (XDG_CACHE_HOME names another one)");
  };
  if (folder.empty()) reject("none by XDG_CACHE_HOME, nor by HOME");
  const TrustedFolder found = trusted_folder(folder);
  if (!found.problem.empty()) reject(found.problem);
  return found.path;
}

/// A folder that is gone when it is done with.
class Workshop {
 public:
  explicit Workshop(const fs::path& parent) {
    std::string name = (parent / "making-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw ModelError("expected to write compiled kernels to " + parent.string() + ", got: " + std::strerror(errno) +
                       " (XDG_CACHE_HOME names another folder)");
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
  std::vector<std::string> command = toolchain.module(toolchain.codegen, "pendula_codegen");
  command.insert(command.end(), arguments.begin(), arguments.end());
  const Ended ended = run_process(command);
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

constexpr const char* flags_of_kernels[] = {
    "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=fast", "-fno-math-errno", "-w"};

/// What a compiler complains of, in a line.
std::string first_error(const std::string& output) {
  return last_line(output.substr(0, output.find('\n', output.find("error"))));
}

/// Throws ModelError where a compiler has failed.
void require_compiled(const Ended& ended, const std::string& compiler, const std::string& name) {
  if (ended.status == 127) {
    throw ModelError("models take a C compiler; " + compiler + ": " + ended.output + " (CC names another one)");
  }
  if (ended.status != 0) {
    throw ModelError("the compiler " + compiler + " refuses the kernel of " + name + ": " + first_error(ended.output) +
                     " (PENDULA_KERNELS_BY=interpreter does without)");
  }
}

/// Runs commands of a compiler side by side. Throws ModelError where one fails.
void run_compilers(const std::vector<std::vector<std::string>>& commands, const std::string& name) {
  std::vector<std::future<Ended>> running(commands.size());
  std::ranges::transform(commands, running.begin(), [](const std::vector<std::string>& command) {
    return std::async(std::launch::async, [&command] { return run_process(command); });
  });
  for (std::future<Ended>& one : running) require_compiled(one.get(), commands.front().front(), name);
}

/// Compiles a kernel; its shared object, beside the text.
fs::path compile(const std::string& name, const fs::path& text, const Toolchain& toolchain) {
  std::vector<std::string> compiler{toolchain.compiler};
  compiler.insert(compiler.end(), std::begin(flags_of_kernels), std::end(flags_of_kernels));
  for (const std::string& flag : architecture_flags()) compiler.push_back(flag);
  for (const std::string& flag : toolchain.flags) compiler.push_back(flag);
  const auto with = [&](std::initializer_list<std::string> more) {
    std::vector<std::string> command = compiler;
    command.insert(command.end(), more);
    return command;
  };
  // The widths of its functions, shared among processors.
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
  run_compilers(commands, name);
  run_compilers({link}, name);
  return made;
}

constexpr std::size_t largest_kernel = std::size_t{256} << 20;

/// What a kept kernel ends in, behind the shared object, whose loader does not look there: a hash of that.
std::string seal_of(std::string_view object) {
  std::ostringstream seal;
  seal << "pendula kernel " << std::hex << std::setw(16) << std::setfill('0') << fingerprint(object) << '\n';
  return seal.str();
}

/// Whether a file is whole: a disk may have been full, or lose what was not yet written when the power went.
bool is_sealed(std::string_view file) {
  const std::size_t size = seal_of({}).size();
  if (file.size() < size) return false;
  return file.substr(file.size() - size) == seal_of(file.substr(0, file.size() - size));
}

void seal(const fs::path& object) {
  const InputFile made = read_input_file(object, largest_kernel);
  std::ofstream stream(object, std::ios::binary | std::ios::app);
  stream << seal_of(made.text);
  stream.close();
  if (!made.problem.empty() || !stream) {
    throw ModelError("expected to write the kernel " + object.string() +
                     ", got: " + (made.problem.empty() ? std::strerror(errno) : made.problem));
  }
}

/// A kernel in use, and its file: as long as that is open, no other has its name.
struct Loaded {
  Descriptor file;
  void* handle = nullptr;

  explicit Loaded(Descriptor opened) : file(std::move(opened)), handle(dlopen(name().c_str(), RTLD_NOW | RTLD_LOCAL)) {}
  Loaded(const Loaded&) = delete;
  Loaded& operator=(const Loaded&) = delete;
  ~Loaded() {
    if (handle != nullptr) dlclose(handle);
  }

  /// Of what was looked at, whatever its path leads to by now.
  std::string name() const { return "/proc/self/fd/" + std::to_string(file.get()); }
};

constexpr const char *compiled = ".so", *interpreted = ".program";  // what files of kernels end in

std::shared_ptr<const SystemTable> table_of_object(Descriptor file) {
  const auto loaded = std::make_shared<Loaded>(std::move(file));
  if (loaded->handle == nullptr) throw std::invalid_argument(dlerror());
  const auto* kernel = static_cast<const CKernel*>(dlsym(loaded->handle, "pendula_kernel"));
  if (kernel == nullptr) throw std::invalid_argument("it has no pendula_kernel");
  return table_of(*kernel, loaded);
}

/// A kept kernel; none, and why in `problem`, where there is none that is whole, the user's own, and of this pendula.
std::shared_ptr<const SystemTable> load(const fs::path& kept, std::string& problem) {
  Descriptor opened(open(kept.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  struct stat status {};
  const auto none = [&](const std::string& why) -> std::shared_ptr<const SystemTable> {
    problem = kept.string() + ": " + why;
    return nullptr;
  };
  if (opened.get() < 0 || fstat(opened.get(), &status) != 0) return none(std::strerror(errno));
  if (status.st_uid != geteuid() && status.st_uid != 0) return none("it belongs to somebody else");
  InputFile file = read_input_file("/proc/self/fd/" + std::to_string(opened.get()), largest_kernel);
  if (!file.problem.empty()) return none(file.problem);
  if (!is_sealed(file.text)) return none("it is not what was written");
  try {
    if (kept.extension() == compiled) return table_of_object(std::move(opened));
    file.text.resize(file.text.size() - seal_of({}).size());
    return table_of(std::move(file.text), *library().interpreter);
  } catch (const std::invalid_argument& error) {
    return none(error.what());
  }
}

/// What files of kernels end in that are made here. Throws ModelError where the environment asks for something else.
const char* kind_of_kernels(const Toolchain& toolchain) {
  const std::string& by = toolchain.kernels_by;
  if (by == "interpreter" || (by == "auto" && toolchain.compiler.empty())) return interpreted;
  if (by != "compiler" && by != "auto") {
    throw ModelError("PENDULA_KERNELS_BY: expected compiler, interpreter or auto, got " + by);
  }
  if (toolchain.compiler.empty()) throw ModelError("models take a C compiler, got no cc, gcc or clang (CC names one)");
  return compiled;
}

/// In words.
std::string how(std::string_view kind, const Toolchain& toolchain) {
  if (kind == compiled) return "compiled by " + toolchain.compiler;
  return toolchain.kernels_by == "auto" ? "interpreted: no C compiler was found (CC names one)" : "interpreted";
}

/// Makes a kernel in `folder`, by arguments of the generator; its file.
fs::path make(std::string_view kind, const std::string& name, std::vector<std::string> arguments,
              const fs::path& folder, const Toolchain& toolchain) {
  const bool compiles = kind == compiled;
  const fs::path text = folder / (compiles ? "kernel.c" : "kernel.program");
  arguments.insert(arguments.end(), {"--as", compiles ? "c" : "bytecode", "--output", text.string()});
  run_generator(arguments, toolchain);
  return compiles ? compile(name, text, toolchain) : text;
}

/// Removes kernels that no run has taken for a quarter of a year: each version of a model and of pendula has its own.
void remove_unused_kernels(const fs::path& cache) {
  const auto oldest = fs::file_time_type::clock::now() - std::chrono::days(90);
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(cache, none)) {
    const fs::file_time_type used = entry.last_write_time(none);
    const fs::path kind = entry.path().extension();
    if (!none && (kind == compiled || kind == interpreted) && used < oldest) fs::remove(entry.path(), none);
  }
}

/// Numbers with commas between them.
template <class Numbers>
std::string numbers_text(const Numbers& numbers) {
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
const SystemTable* built_in_table(const std::string& model, std::optional<int> links) {
  if (model.ends_with(".py")) return nullptr;
  for (const SystemTable* table : library().systems) {
    if (table->info.name == kernel_name(model, links)) return table;
  }
  return nullptr;
}

}  // namespace

Toolchain Toolchain::of_this_program() {
  Toolchain toolchain;
  const fs::path folder = this_program().parent_path(), prefix = folder.parent_path();
  // Of a program in its build folder: a Python, the generator, the plots, scenarios, a line each.
  std::ifstream beside(folder / "pendula.toolchain");
  if (beside) {
    std::string line;
    std::getline(beside, toolchain.python);
    for (fs::path* package : {&toolchain.codegen, &toolchain.plotting, &toolchain.examples}) {
      if (std::getline(beside, line)) *package = line;
    }
  } else {
    const fs::path own = prefix / configured::installed_python;  // made by setup()
    toolchain.python = fs::exists(own) ? own.string() : "python3";
    toolchain.codegen = prefix / configured::installed_codegen;
    toolchain.plotting = prefix / configured::installed_plotting;
    toolchain.examples = prefix / configured::installed_examples;
  }
  toolchain.python = environment("PENDULA_PYTHON", toolchain.python);
  toolchain.compiler = environment("CC", find_compiler());
  toolchain.kernels_by = environment("PENDULA_KERNELS_BY", "auto");
  std::istringstream flags(environment("CFLAGS", ""));
  for (std::string flag; flags >> flag;) toolchain.flags.push_back(flag);
  toolchain.cache = cache_folder();
  return toolchain;
}

// Python would look for modules in the folder that it is started in before it looks anywhere else, and in those of
// PYTHONPATH (-E): somebody else's sympy.py would run. `-P`, which is made for that, is no older than Python 3.11.
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
  return built_in_table(model, links) ? "" : read_model(find_model(model, folder, toolchain));
}

std::string_view ModelKernel::by() const {
  if (file.empty()) return "build";
  return file.extension() == compiled ? "compiler" : "interpreter";
}

ModelKernel find_kernel(const std::string& model, std::optional<int> links, const fs::path& folder,
                        const Toolchain& toolchain, const std::function<void(const std::string&)>& tell) {
  if (const SystemTable* table = built_in_table(model, links)) return {{}, {table, [](const SystemTable*) {}}};
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
  const char* const kind = kind_of_kernels(toolchain);
  const fs::path cache = require_cache(toolchain.cache), kept = cache / (name + "-" + key.text() + kind);
  std::string problem;
  std::shared_ptr<const SystemTable> table = load(kept, problem);
  const bool was_there = table != nullptr;
  if (was_there) {
    fs::last_write_time(kept, fs::file_time_type::clock::now(), none);  // used again
  } else {
    const Workshop workshop(cache);
    tell("deriving the kernel of " + name + ", once; " + how(kind, toolchain));
    const fs::path made = make(kind, name, about("program", file, links), workshop.folder(), toolchain);
    seal(made);
    fs::rename(made, kept);
    table = load(kept, problem);
    if (!table) throw ModelError("the kernel cannot be loaded: " + problem);
  }
  remove_unused_kernels(cache);
  return {kept, table, was_there};
}

std::vector<double> written_values(const std::string& model, std::optional<int> links, const fs::path& folder,
                                   const Toolchain& toolchain, std::span<const double> parameters, const Motion& start,
                                   unsigned seed) {
  std::vector<std::string> arguments = about("written", find_model(model, folder, toolchain), links);
  const auto add = [&](const char* name, const std::string& value) { arguments.push_back(name + ('=' + value)); };
  add("--parameters", numbers_text(parameters));
  add("--time", shortest(start.time));
  add("--q", numbers_text(start.q));
  add("--v", numbers_text(start.v));
  add("--seed", std::to_string(seed));
  std::istringstream words(last_line(run_generator(arguments, toolchain)));
  std::vector<double> numbers;
  for (std::string word; words >> word;) numbers.push_back(std::strtod(word.c_str(), nullptr));
  return numbers;
}

}  // namespace pendula::io
