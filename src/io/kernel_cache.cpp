#include "io/kernel_cache.hpp"

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <system_error>

#include "io/files.hpp"
#include "io/generator.hpp"
#include "io/kernel_file.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

/// A hash of all that a compiled kernel depends on.
class Key {
 public:
  Key& add(std::string_view text) {
    hash_ = fingerprint(std::to_string(text.size()) + ':', hash_);
    hash_ = fingerprint(text, hash_);
    return *this;
  }
  /// Adds size and time of a file.
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

/// The folder of kernels. Since kernels are code, nobody else may be able to write there. Throws ModelError.
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

[[noreturn]] void reject_kept(const fs::path& kept, const std::string& got) {
  throw ModelError("expected to keep the compiled kernel in " + kept.string() + ", got: " + got);
}

void put(const fs::path& made, const fs::path& kept) {
  std::error_code error;
  fs::rename(made, kept, error);
  if (error) reject_kept(kept, error.message());
}

/// A temporary folder, removed by the destructor.
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

/// The kernel of a built-in model, if this build has it; else null.
const SystemTable* built_in_table(const ModelName& name) {
  if (name.model.ends_with(".py")) return nullptr;
  for (const SystemTable* table : library<KernelList<Models>>().tables) {
    if (table->info.name == kernel_name(name)) return table;
  }
  return nullptr;
}

/// The kernel of a model from the cache, or made now.
ModelKernel kept_kernel(const ModelName& model, const Toolchain& toolchain,
                        const std::function<void(const std::string&)>& tell) {
  const std::string name = kernel_name(model);
  const std::vector<std::string> arguments = about("program", model, toolchain);
  Key key;
  key.add(read_model(find_model(model, toolchain))).add(name).add(version).add(instruction_set());
  for (const InputLaw& law : model.laws) key.add(law.input).add(law.value);
  key.add(toolchain.python).add(toolchain.compiler).add_file(this_program());
  for (const std::string& flag : toolchain.flags) key.add(flag);
  std::error_code none;
  for (const auto& part : fs::recursive_directory_iterator(toolchain.codegen / "pendula_codegen", none)) {
    if (part.path().extension() == ".py" || part.path().extension() == ".j2") key.add_file(part.path());
  }
  const char* const kind = kind_of_kernels(toolchain);
  const fs::path cache = require_cache(toolchain.cache), kept = cache / (name + "-" + key.text() + kind);
  std::string problem;
  std::shared_ptr<const SystemTable> table = load_kernel(kept, toolchain, problem);
  const bool was_there = table != nullptr;
  if (fs::is_directory(fs::symlink_status(kept, none))) reject_kept(kept, "a folder in its place");
  if (was_there) {
    fs::last_write_time(kept, fs::file_time_type::clock::now(), none);  // marks it as used
  } else {
    const Workshop workshop(cache);
    // Told only once the model is known to be right: an error of the model stands alone.
    const auto derived = [&] {
      tell("derived the kernel of " + name + (model.laws.empty() ? "" : " with drives or feedback") + ", once; " +
           how_made(kind, toolchain) + (problem.empty() ? "" : " (not loaded: " + problem + ")"));
    };
    const fs::path made = make_kernel(kind, name, arguments, workshop.folder(), toolchain, derived);
    seal_kernel(made);
    put(made, kept);
    table = load_kernel(kept, toolchain, problem);
    if (!table) throw ModelError("the kernel cannot be loaded: " + problem);
  }
  remove_unused_kernels(cache);
  return {kept, table, was_there};
}

}  // namespace

std::string model_source(const ModelName& name, const Toolchain& toolchain) {
  return built_in_table(name) ? "" : read_model(find_model(name, toolchain));
}

std::string_view ModelKernel::by() const {
  if (file.empty()) return "build";
  if (file.extension() == llvm_kernel) return "llvm";
  return file.extension() == compiled_kernel ? "compiler" : "interpreter";
}

ModelKernel find_kernel(const ModelName& model, const Toolchain& toolchain,
                        const std::function<void(const std::string&)>& tell) {
  const SystemTable* const own = model.laws.empty() ? built_in_table(model) : nullptr;
  if (own != nullptr) return {{}, {own, [](const SystemTable*) {}}};
  return kept_kernel(model, toolchain, tell);
}

std::string kernel_program(const ModelName& model, Toolchain toolchain,
                           const std::function<void(const std::string&)>& tell) {
  toolchain.kernels_by = "interpreter";
  return program_in(kept_kernel(model, toolchain, tell).file);
}

}  // namespace pendula::io
