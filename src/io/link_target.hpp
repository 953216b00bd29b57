#pragma once

#include <string>

namespace pendula::io {

/// The file that a name leads to by links, whether it is there or not.
std::string link_target(const std::string& name);

}  // namespace pendula::io
