#pragma once

#include <filesystem>
#include <string>

namespace pendula::io {

/// A folder that code may be loaded from, or why it may not.
struct TrustedFolder {
  std::filesystem::path path;  ///< without links
  std::string problem;         ///< empty where nobody but its user and root can have put a file there
};

/// Makes the folder where it is not there, for its user alone. Looks at every folder on the way to it, as sshd does:
/// each belongs to root or to the user of this program, and nobody else may write there, but to a folder like /tmp,
/// where files can be renamed by their owners only. What is checked is the path without links, which nobody else can
/// make lead elsewhere.
TrustedFolder trusted_folder(const std::filesystem::path& folder);

}  // namespace pendula::io
