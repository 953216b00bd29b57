#pragma once

#include <cstddef>
#include <pendula/run/subject.hpp>
#include <vector>

namespace pendula {

/// The columns of a row that hold coordinates, then of those that hold their rates, in the order of a motion: of a
/// chain all theta, then all phi.
std::vector<std::size_t> state_columns(const Subject& subject);

}  // namespace pendula
