#pragma once

#include <pendula/lanes/plain_lanes.hpp>

namespace pendula {

/// Members of generated kernels in lanes, by explicit methods; nullptr for others.
MoveSystemMembers* system_lanes(const RunOptions& options);
/// The same with a tangent of each.
MoveSystemMembers* system_tangent_lanes(const RunOptions& options);

}  // namespace pendula
