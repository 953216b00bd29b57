#include "library/lane_stages.hpp"

namespace pendula {

template MoveMembers* chain_lanes<Spatial>(int);

}  // namespace pendula
