#include "library/lane_methods.hpp"

namespace pendula {

template MoveMembers* tangent_lanes<Spatial>(const RunOptions&);

}  // namespace pendula
