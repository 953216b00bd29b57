#include "library/system_lane_methods.hpp"

namespace pendula {
namespace {

struct SystemTangentMoves {
  template <class Method>
  static MoveSystemMembers* by() {
    return &move_systems<SystemTangentLanes<Method>>;
  }
};

}  // namespace

MoveSystemMembers* system_tangent_lanes(const RunOptions& options) {
  return detail::explicit_lanes<SystemTangentMoves>(options.method);
}

}  // namespace pendula
