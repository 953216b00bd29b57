#pragma once

#include <pendula/chain/space.hpp>
#include <pendula/run/plain_members.hpp>

namespace pendula {

/// Moves members in lanes: by Gauss methods with the stages that stages_for returns, by fehlberg78, and by Taylor
/// series; nullptr for other options.
template <class Space>
MoveMembers* chain_lanes(const RunOptions& options);

extern template MoveMembers* chain_lanes<Planar>(const RunOptions&);
extern template MoveMembers* chain_lanes<Spatial>(const RunOptions&);

/// The same with a tangent of each member.
template <class Space>
MoveMembers* tangent_lanes(const RunOptions& options);

extern template MoveMembers* tangent_lanes<Planar>(const RunOptions&);
extern template MoveMembers* tangent_lanes<Spatial>(const RunOptions&);

/// Moves members of generated kernels in lanes, as chain_lanes moves those of chains.
MoveSystemMembers* system_lanes(const RunOptions& options);
/// The same with a tangent of each member.
MoveSystemMembers* system_tangent_lanes(const RunOptions& options);

}  // namespace pendula
