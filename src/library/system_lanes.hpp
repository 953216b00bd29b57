#pragma once

#include <pendula/run/plain_members.hpp>

namespace pendula {

/// Members of generated kernels in lanes, by explicit methods and Gauss's; nullptr for others.
MoveSystemMembers* system_lanes(const RunOptions& options);
/// Those of so many stages.
MoveSystemMembers* gauss_system_lanes(int stages);
/// The same with a tangent of each.
MoveSystemMembers* system_tangent_lanes(const RunOptions& options);

}  // namespace pendula
