#pragma once

#include <pendula/run/plain_members.hpp>

namespace pendula {

/// Moves members of generated kernels in lanes, as chain_lanes moves those of chains.
MoveSystemMembers* system_lanes(const RunOptions& options);
/// The same with a tangent of each member.
MoveSystemMembers* system_tangent_lanes(const RunOptions& options);

}  // namespace pendula
