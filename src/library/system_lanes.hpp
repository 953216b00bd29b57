#pragma once

#include <pendula/run/plain_members.hpp>

namespace pendula {

/// Moves members of generated kernels in lanes, by explicit and Gauss methods and Taylor series; nullptr for
/// other methods.
MoveSystemMembers* system_lanes(const RunOptions& options);
/// The same by the Gauss method with this number of stages.
MoveSystemMembers* gauss_system_lanes(int stages);
/// The same with a tangent of each member.
MoveSystemMembers* system_tangent_lanes(const RunOptions& options);

}  // namespace pendula
