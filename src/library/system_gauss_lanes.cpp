#include "library/system_lane_methods.hpp"

namespace pendula {

MoveSystemMembers* gauss_system_lanes(int stages) {
  switch (stages) {
    case 4:
      return &move_systems<GaussSystemLanes<4>>;
#ifndef PENDULA_FEW_LANES  // where sanitizers make minutes of their compilation
    case 2:
      return &move_systems<GaussSystemLanes<2>>;
    case 6:
      return &move_systems<GaussSystemLanes<6>>;
    case 8:
      return &move_systems<GaussSystemLanes<8>>;
#endif
    default:
      return nullptr;
  }
}

}  // namespace pendula
