#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/ensemble/plain_queue.hpp>
#include <vector>

#include "library/lanes.hpp"

namespace pendula {

template <class Space, class Queue>
bool move_members(const RunOptions& options, std::int64_t every, std::span<const PlainMember<PlainChain>> members,
                  std::span<MemberEnd> ends, MemberWatch& watch) {
  if (members.empty()) return true;
  return detail::move_by<Queue>(members[0].model.links, options, every, members, ends, watch);
}

/// The series of short chains, whose number of links is known at compile time, are summed in registers.
template <class Space>
bool move_by_series(const RunOptions& options, std::int64_t every, std::span<const PlainMember<PlainChain>> members,
                    std::span<MemberEnd> ends, MemberWatch& watch) {
  [[maybe_unused]] const int links = members.empty() ? 0 : members[0].model.links;
#ifndef PENDULA_FEW_LANES
  if (links == 1) return move_members<Space, TaylorLanes<Space, 1>>(options, every, members, ends, watch);
  if (links == 2) return move_members<Space, TaylorLanes<Space, 2>>(options, every, members, ends, watch);
  if (links == 3) return move_members<Space, TaylorLanes<Space, 3>>(options, every, members, ends, watch);
#endif
  return move_members<Space, TaylorLanes<Space>>(options, every, members, ends, watch);
}

template <class Space>
struct PlainMoves {
  static MoveMembers* by_series() { return &move_by_series<Space>; }
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
  static MoveMembers* by_series() { return &move_members<Space, TaylorTangentLanes<Space>>; }
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

template <class Queue>
bool move_systems(const SystemTable& table, const RunOptions& options, std::int64_t every,
                  std::span<const PlainMember<PlainSystem>> members, std::span<MemberEnd> ends, MemberWatch& watch) {
  MemberSystems<typename Queue::L> dynamics(table);
  return detail::move_by<Queue>(dynamics, options, every, members, ends, watch);
}

}  // namespace pendula
