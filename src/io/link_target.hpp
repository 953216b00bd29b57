#pragma once

#include <string>

namespace pendula::io {

/// Follows symbolic links; the file need not exist.
std::string link_target(const std::string& name);

}  // namespace pendula::io
