#pragma once

#include <pendula/pendula.h>

#include <pendula/system/options.hpp>

namespace pendula::front {

/// What is asked for, by names. Throws std::invalid_argument, with those that there are, for a name that is none.
RunOptions options_of(const pendula_options* given);

}  // namespace pendula::front
