#include "io/trusted_folder.hpp"

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>
#include <system_error>

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

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
