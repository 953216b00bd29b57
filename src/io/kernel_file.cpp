#include "io/kernel_file.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <pendula/run/library.hpp>
#include <pendula/system/c_kernel.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/provenance.hpp"

namespace pendula::io {

namespace fs = std::filesystem;

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

/// A path to an open file, each time another one. The loader takes objects of one name for one, and need not unload
/// what is closed: if the path were that of the descriptor alone, a later kernel could turn out to be an earlier one.
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
    return table_of(std::move(file.text), *library().interpreter);
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
