#pragma once

#include <pendula/chain/space.hpp>
#include <pendula/lanes/plain_lanes.hpp>

namespace pendula {

/// Members in lanes by Gauss steps of as many stages as a tolerance may ask for (stages_for), or of two; nullptr for
/// other numbers of them.
template <class Space>
MoveMembers* chain_lanes(int stages);

extern template MoveMembers* chain_lanes<Planar>(int);
extern template MoveMembers* chain_lanes<Spatial>(int);

}  // namespace pendula
