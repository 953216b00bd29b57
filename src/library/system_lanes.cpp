#include "library/system_lane_methods.hpp"

namespace pendula {
namespace {

struct SystemMoves {
  template <class Method>
  static MoveSystemMembers* by() {
    return &move_systems<SystemLanes<Method>>;
  }
};

}  // namespace

MoveSystemMembers* system_lanes(const RunOptions& options) {
  return detail::explicit_lanes<SystemMoves>(options.method);
}

}  // namespace pendula
