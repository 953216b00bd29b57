#include "library/system_lane_methods.hpp"

namespace pendula {
namespace {

struct SystemMoves {
  static MoveSystemMembers* by_series() { return &move_systems<SystemSeriesLanes<>>; }
  template <class Method>
  static MoveSystemMembers* by() {
    return &move_systems<SystemLanes<Method>>;
  }
};

}  // namespace

MoveSystemMembers* system_lanes(const RunOptions& options) {
  if (options.method == Method::gauss) return gauss_system_lanes(options.stages);
  return detail::explicit_lanes<SystemMoves>(options.method);
}

}  // namespace pendula
