#pragma once

#include <sys/stat.h>

#include <filesystem>
#include <string>

namespace pendula::io {

/// A folder from which code may be loaded, or why it may not.
struct TrustedFolder {
  std::filesystem::path path;  ///< without symbolic links
  std::string problem;         ///< empty if only its user and root can have put files there
};

/// Makes the folder, if needed, for its user alone. Checks every folder on the path, as sshd does: it must belong to
/// root or to the user of this program, and nobody else may write there, except in sticky folders such as /tmp. The
/// checked path has no symbolic links, so that nobody can redirect it.
TrustedFolder trusted_folder(const std::filesystem::path& folder);

/// Whether anybody but the owner, or a group of the user alone, may write to a file or folder.
bool others_may_write(const struct stat& status);

}  // namespace pendula::io
