#include "library/system_lanes.hpp"

#include <Eigen/Core>
#include <pendula/lanes/lane_queue.hpp>
#include <pendula/lanes/plain_queue.hpp>
#include <vector>

namespace pendula {
namespace {

template <class Queue>
bool move_systems(LaneDynamics& dynamics, const RunOptions& options, std::int64_t every,
                  std::span<const PlainSystemMember> members, std::span<PlainMemberEnd> ends, LaneWatch& watch) {
  const auto numbers = [&](const double* from) {
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(from, dynamics.coordinates()));
  };
  std::vector<LaneSystemMember> starts;
  starts.reserve(members.size());
  for (const PlainSystemMember& member : members) {
    starts.push_back({Motion(member.start, numbers(member.q), numbers(member.v)), member.end, member.system});
  }
  return detail::move_plainly<Queue>(dynamics, options, every, starts, ends, watch);
}

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
