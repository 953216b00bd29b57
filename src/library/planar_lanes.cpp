#include "library/lane_methods.hpp"

namespace pendula {

template MoveMembers* chain_lanes<Planar>(const RunOptions&);

}  // namespace pendula
