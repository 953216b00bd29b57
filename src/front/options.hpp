#pragma once

#include <pendula/pendula.h>

#include <pendula/system/options.hpp>

namespace pendula::front {

/// The options that are given by names. Throws std::invalid_argument, with the known names, for an unknown one.
RunOptions options_of(const pendula_options* given);

}  // namespace pendula::front
