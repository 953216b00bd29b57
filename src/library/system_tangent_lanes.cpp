#include "library/lane_methods.hpp"

namespace pendula {
namespace {

struct SystemTangentMoves {
  static MoveSystemMembers* by_series() { return nullptr; }
  template <class Method>
  static MoveSystemMembers* by() {
    return &move_systems<SystemTangentLanes<Method>>;
  }
  template <int S>
  static MoveSystemMembers* of() {
    return &move_systems<GaussSystemTangentLanes<S>>;
  }
};

}  // namespace

MoveSystemMembers* system_tangent_lanes(const RunOptions& options) {
  return detail::lanes_of<SystemTangentMoves>(options);
}

}  // namespace pendula
