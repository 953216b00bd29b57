#pragma once

#include <Eigen/Core>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/ensemble/plain_queue.hpp>
#include <vector>

#include "library/system_lanes.hpp"

namespace pendula {

template <class Queue>
bool move_systems(const SystemTable& table, const RunOptions& options, std::int64_t every,
                  std::span<const PlainSystemMember> members, std::span<PlainMemberEnd> ends, MemberWatch& watch) {
  MemberSystems<typename Queue::L> dynamics(table);
  const auto numbers = [&](const double* from) {
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(from, dynamics.coordinates()));
  };
  std::vector<QueueSystemMember> starts;
  starts.reserve(members.size());
  for (const PlainSystemMember& member : members) {
    starts.push_back({Motion(member.start, numbers(member.q), numbers(member.v)), member.end, member.system});
  }
  return detail::move_plainly<Queue>(dynamics, options, every, starts, ends, watch);
}

}  // namespace pendula
