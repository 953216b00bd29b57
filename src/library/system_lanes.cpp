#include "library/lane_methods.hpp"

namespace pendula {
namespace {

struct SystemMoves {
  static MoveSystemMembers* by_series() { return &move_systems<SystemSeriesLanes<>>; }
  template <class Method>
  static MoveSystemMembers* by() {
    return &move_systems<SystemLanes<Method>>;
  }
  template <int S>
  static MoveSystemMembers* of() {
    return &move_systems<GaussSystemLanes<S>>;
  }
};

}  // namespace

MoveSystemMembers* system_lanes(const RunOptions& options) {
  return detail::lanes_of<SystemMoves>(options);
}

}  // namespace pendula
