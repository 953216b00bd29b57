#include "library/lane_methods.hpp"

namespace pendula {

template MoveMembers* tangent_lanes<Planar>(const RunOptions&);

}  // namespace pendula
