#pragma once

#include <pendula/chain/space.hpp>
#include <pendula/run/plain_members.hpp>

namespace pendula {

/// Members in lanes: by Gauss steps of as many stages as a tolerance may ask for (stages_for), or of two, and by
/// explicit Runge–Kutta methods; nullptr for others.
template <class Space>
MoveMembers* chain_lanes(const RunOptions& options);

extern template MoveMembers* chain_lanes<Planar>(const RunOptions&);
extern template MoveMembers* chain_lanes<Spatial>(const RunOptions&);

/// The same with a tangent of each member.
template <class Space>
MoveMembers* tangent_lanes(const RunOptions& options);

extern template MoveMembers* tangent_lanes<Planar>(const RunOptions&);
extern template MoveMembers* tangent_lanes<Spatial>(const RunOptions&);

}  // namespace pendula
