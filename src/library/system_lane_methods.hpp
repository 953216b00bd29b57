#pragma once

#include <Eigen/Core>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/ensemble/plain_queue.hpp>
#include <vector>

#include "library/system_lanes.hpp"

namespace pendula {

template <class Queue>
bool move_systems(const SystemTable& table, const RunOptions& options, std::int64_t every,
                  std::span<const PlainMember<PlainSystem>> members, std::span<MemberEnd> ends, MemberWatch& watch) {
  MemberSystems<typename Queue::L> dynamics(table);
  return detail::move_by<Queue>(dynamics, options, every, members, ends, watch);
}

}  // namespace pendula
