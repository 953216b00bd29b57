#include "io/files.hpp"

#include <fcntl.h>
#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "io/errors.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

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

/// Waits until a pipe has been opened for writing; false if that takes too long. A non-blocking read finds the end of
/// the file until then. Puts what it reads into `text`.
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

WholeFile::WholeFile(const std::string& name) : name_(name), target_(name) {
  std::error_code unknown;
  if (name.empty() || fs::is_directory(name, unknown)) reject_output(name, name, name.empty() ? ENOENT : EISDIR);
  const bool is_special = fs::exists(name, unknown) && !fs::is_regular_file(name, unknown);
  if (!is_special) target_ = link_target(name);
  if (fs::exists(target_, unknown) && access(target_.c_str(), W_OK) != 0) reject_output(name, target_, errno);
  if (!is_special) part_ = target_ + ".part" + std::to_string(getpid());
  const std::string& opened = is_special ? target_ : part_;
  descriptor_ = open(opened.c_str(), O_WRONLY | O_CLOEXEC | (is_special ? 0 : O_CREAT | O_TRUNC), 0666);
  if (descriptor_ < 0) reject_output(name, target_, errno);
}

WholeFile::~WholeFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  if (!part_.empty()) unlink(part_.c_str());
}

void WholeFile::write(std::string_view text) {
  write_all(text);
  if (::close(std::exchange(descriptor_, -1)) != 0) fail(errno);
  if (!part_.empty() && std::rename(part_.c_str(), target_.c_str()) != 0) fail(errno);
}

void WholeFile::write_all(std::string_view text) const {
  while (!text.empty()) {
    const ssize_t bytes = ::write(descriptor_, text.data(), text.size());
    if (bytes < 0 && errno == EINTR) continue;
    if (bytes <= 0) fail(bytes < 0 ? errno : ENOSPC);
    text.remove_prefix(static_cast<std::size_t>(bytes));
  }
}

void WholeFile::fail(int error) const {
  if (!part_.empty()) unlink(part_.c_str());
  throw OutputError(name_, error);
}

std::string link_target(const std::string& name) {
  std::error_code unknown;
  fs::path file = name;
  for (int links = 0; links < 40 && fs::is_symlink(file, unknown); ++links) {
    file = file.parent_path() / fs::read_symlink(file, unknown);
  }
  return file.string();
}

namespace {

constexpr std::array<std::string_view, 3> hdf5_endings = {".h5", ".hdf5", ".nc"};

bool has_ending_of(const std::string& file, FileFormat format) {
  if (format == FileFormat::csv) return file.ends_with(".csv");
  return std::ranges::any_of(hdf5_endings, [&](std::string_view ending) { return file.ends_with(ending); });
}

/// Whether a file is a device or a pipe: rows go there as they come, whatever its name.
bool is_stream(const std::string& file) {
  std::error_code unknown;
  const fs::file_status status = fs::status(file, unknown);
  return file == "-" || (fs::exists(status) && !fs::is_regular_file(status));
}

}  // namespace

FileFormat format_of(const std::string& file) {
  if (has_ending_of(file, FileFormat::hdf5)) return FileFormat::hdf5;
  if (has_ending_of(file, FileFormat::csv) || is_stream(file)) return FileFormat::csv;
  throw InputError(file +
                   ": expected a name that ends in .csv, or in .h5, .hdf5 or .nc (HDF5), or - for standard "
                   "output");
}

void require_format(const std::string& file, FileFormat format, const std::string& what) {
  if (has_ending_of(file, format) || (format == FileFormat::csv && is_stream(file))) return;
  const std::string endings = format == FileFormat::csv ? ".csv" : ".h5, .hdf5 or .nc";
  throw InputError(file + ": expected a name that ends in " + endings + ", for " + what);
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

// HDF5 uses flock; readers of the file take that one. This lock is of another kind (OFD).
void FileLock::take(const std::string& file, const std::string& name) {
  descriptor_ = open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor_ < 0) reject_output(name, file, errno);
  struct flock whole {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  if (fcntl(descriptor_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES)) {
    reject_output(name, "one that another run writes");
  }
}

namespace {

/// Whether a group is a user's private group: it has the user's name and no other members.
bool is_group_of_one(gid_t id) {
  const group* const found = getgrgid(id);
  const passwd* const user = getpwuid(geteuid());
  if (found == nullptr || user == nullptr || std::string_view(found->gr_name) != user->pw_name) return false;
  for (char* const* member = found->gr_mem; *member != nullptr; ++member) {
    if (std::string_view(*member) != user->pw_name) return false;
  }
  return true;
}

}  // namespace

bool others_may_write(const struct stat& status) {
  const bool by_all = (status.st_mode & S_IWOTH) != 0;
  return by_all || ((status.st_mode & S_IWGRP) != 0 && !is_group_of_one(status.st_gid));
}

namespace {

/// `is_on_way` is true for all but the last folder of a path.
std::string problem_of(const fs::path& folder, bool is_on_way) {
  struct stat status {};
  if (lstat(folder.c_str(), &status) != 0) return folder.string() + ": " + std::strerror(errno);
  if (status.st_uid != 0 && status.st_uid != geteuid()) {
    const passwd* const owner = getpwuid(status.st_uid);
    const std::string id = std::to_string(status.st_uid);
    return folder.string() + ", which belongs to " + (owner == nullptr ? "the user " + id : owner->pw_name);
  }
  if (is_on_way && (status.st_mode & S_ISVTX) != 0) return "";
  return others_may_write(status) ? folder.string() + ", which others may write to" : "";
}

/// Returns the errno of the folder that could not be made; 0 if all exist.
int make(const fs::path& folder) {
  fs::path way;
  int error = 0;
  for (const fs::path& part : folder) {
    way /= part;
    error = mkdir(way.c_str(), S_IRWXU) == 0 || errno == EEXIST ? 0 : errno;
  }
  return error;
}

}  // namespace

TrustedFolder trusted_folder(const fs::path& folder) {
  const int made = make(folder);
  std::error_code error;
  TrustedFolder found{fs::canonical(folder, error), {}};
  if (error) return {{}, folder.string() + ": " + (made != 0 ? std::strerror(made) : error.message())};
  fs::path way;
  for (const fs::path& part : found.path) {
    way /= part;
    found.problem = problem_of(way, way != found.path);
    if (!found.problem.empty()) break;
  }
  return found;
}

}  // namespace pendula::io
