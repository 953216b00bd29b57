#include "io/input_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <string_view>
#include <thread>

#include "io/descriptor.hpp"

namespace pendula::io {
namespace {

InputFile problem(const std::string& what) {
  return {{}, what};
}

std::string too_long(std::size_t most) {
  return "more than " + std::to_string(most >> 20) + " MiB";
}

InputFile read_all(int descriptor, std::size_t most) {
  InputFile file;
  std::array<char, std::size_t{1} << 16> block;
  while (true) {
    const ssize_t count = read(descriptor, block.data(), block.size());
    if (count == 0) return file;
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return problem(std::strerror(errno));
    file.text.append(block.data(), static_cast<std::size_t>(count));
    if (file.text.size() > most) return problem(too_long(most));
  }
}

/// Waits until somebody has opened a pipe for writing; false if nobody does in time. A non-blocking read finds an end
/// until then. What it reads is put into `text`.
bool has_writer(int pipe, std::string& text) {
  using namespace std::chrono_literals;
  for (const auto end = std::chrono::steady_clock::now() + 2s; std::chrono::steady_clock::now() < end;) {
    std::array<char, 4096> block;
    const ssize_t count = read(pipe, block.data(), block.size());
    if (count > 0) text.assign(block.data(), static_cast<std::size_t>(count));
    if (count != 0) return true;
    std::this_thread::sleep_for(10ms);
  }
  return false;
}

}  // namespace

InputFile read_standard_input(std::size_t most) {
  return read_all(STDIN_FILENO, most);
}

InputFile read_input_file(const std::filesystem::path& file, std::size_t most) {
  const Descriptor opened(open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  if (opened.get() < 0 || fstat(opened.get(), &status) != 0) return problem(std::strerror(errno));
  if (S_ISDIR(status.st_mode)) return problem("a folder");
  if (S_ISREG(status.st_mode) && static_cast<std::size_t>(status.st_size) > most) return problem(too_long(most));
  std::string first;
  if (S_ISFIFO(status.st_mode) && !has_writer(opened.get(), first)) return problem("a pipe that nobody writes to");
  if (fcntl(opened.get(), F_SETFL, O_RDONLY) != 0) return problem(std::strerror(errno));
  InputFile rest = read_all(opened.get(), most);
  rest.text.insert(0, first);
  return rest;
}

}  // namespace pendula::io
