#include "library/system_lane_methods.hpp"

namespace pendula {
namespace {

struct GaussSystemMoves {
  template <int S>
  static MoveSystemMembers* of() {
    return &move_systems<GaussSystemLanes<S>>;
  }
};

}  // namespace

MoveSystemMembers* gauss_system_lanes(int stages) {
  return detail::gauss_lanes<GaussSystemMoves>(stages);
}

}  // namespace pendula
