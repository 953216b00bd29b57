#include "library/lane_methods.hpp"

namespace pendula {

template MoveMembers* chain_lanes<Spatial>(const RunOptions&);

}  // namespace pendula
