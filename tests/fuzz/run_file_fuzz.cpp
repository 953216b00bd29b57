// Run files: any bytes are a run that can go on, or an InputError.
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "io/errors.hpp"
#include "io/run_source.hpp"
#include "io/saved_run.hpp"

namespace pendula::io {
namespace {

/// A name in memory, of this process.
const std::string& file() {
  static const std::string name = [] {
    const std::filesystem::path memory = "/dev/shm";
    const auto folder = std::filesystem::is_directory(memory) ? memory : std::filesystem::temp_directory_path();
    return (folder / ("pendula_run_file_fuzz_" + std::to_string(getpid()) + ".h5")).string();
  }();
  return name;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::ofstream(file(), std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  try {
    const RunSource source = resumed_source(file(), read_saved_run(file()), {});
    checkpoint_of(source, 1e9);
  } catch (const InputError&) {
    // as it should be
  }
  std::filesystem::remove(file());
  return 0;
}

}  // namespace pendula::io
