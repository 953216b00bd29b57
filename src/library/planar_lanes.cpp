#include "library/lane_stages.hpp"

namespace pendula {

template MoveMembers* chain_lanes<Planar>(int);

}  // namespace pendula
