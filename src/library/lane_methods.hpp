#pragma once

#include <cstddef>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/lanes/lane_queue.hpp>
#include <pendula/lanes/plain_queue.hpp>
#include <vector>

#include "library/chain_lanes.hpp"

namespace pendula {

template <class Space, class Queue>
bool move_members(const RunOptions& options, std::int64_t every, std::span<const PlainMember> members,
                  std::span<PlainMemberEnd> ends, LaneWatch& watch) {
  if (members.empty()) return true;
  std::vector<Chain<Space>> chains;
  chains.reserve(members.size());  // so that pointers to them stay
  std::vector<LaneMember<Space>> starts;
  starts.reserve(members.size());
  for (const PlainMember& member : members) {
    const auto numbers = [&](const double* from) {
      return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(from, Space::dof * member.chain.links));
    };
    chains.push_back(chain_of<Space>(member.chain));
    starts.push_back({Motion(member.start, numbers(member.q), numbers(member.v)), member.end, &chains.back()});
  }
  return detail::move_plainly<Queue>(chains.front(), options, every, starts, ends, watch);
}

template <class Space>
struct PlainMoves {
  template <class Method>
  static MoveMembers* by() {
    return &move_members<Space, ExplicitLanes<Space, Method>>;
  }
  template <int S>
  static MoveMembers* of() {
    return &move_members<Space, GaussLanes<Space, S>>;
  }
};

template <class Space>
struct TangentMoves {
  template <class Method>
  static MoveMembers* by() {
    return &move_members<Space, TangentLanes<Space, Method>>;
  }
  template <int S>
  static MoveMembers* of() {
    return &move_members<Space, GaussTangentLanes<Space, S>>;
  }
};

template <class Space>
MoveMembers* chain_lanes(const RunOptions& options) {
  return detail::lanes_of<PlainMoves<Space>>(options);
}

template <class Space>
MoveMembers* tangent_lanes(const RunOptions& options) {
  return detail::lanes_of<TangentMoves<Space>>(options);
}

}  // namespace pendula
