#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <pendula/lanes/lane_queue.hpp>
#include <pendula/lanes/plain_queue.hpp>
#include <vector>

#include "library/system_lanes.hpp"

namespace pendula {

/// A kernel that was compiled for another instruction set has other lanes: its members stay where they are.
inline void leave(std::span<const PlainSystemMember> members, int coordinates, std::span<PlainMemberEnd> ends) {
  for (std::size_t k = 0; k < members.size(); ++k) {
    std::copy_n(members[k].q, coordinates, ends[k].q);
    std::copy_n(members[k].v, coordinates, ends[k].v);
    ends[k].time = members[k].start;
    ends[k].status = Status::not_converged;
  }
}

template <class Queue>
bool move_systems(LaneDynamics& dynamics, const RunOptions& options, std::int64_t every,
                  std::span<const PlainSystemMember> members, std::span<PlainMemberEnd> ends, LaneWatch& watch) {
  if (dynamics.lanes() != Queue::lanes) {
    leave(members, dynamics.coordinates(), ends);
    return true;
  }
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

}  // namespace pendula
