#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/lanes/lane_queue.hpp>
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
  LaneOptions asked;
  asked.step = is_adaptive(options) ? 0 : options.step;
  asked.tolerance = options.tolerance;
  asked.energy_every = every;
  Queue queue(chains.front(), asked);
  queue.set_watch(watch);
  std::vector<LaneEnd> reached(members.size());
  const bool is_done = queue.run(starts, reached);
  for (std::size_t k = 0; k < members.size(); ++k) {
    const LaneEnd& from = reached[k];
    PlainMemberEnd& to = ends[k];
    std::copy_n(from.motion.q.data(), from.motion.q.size(), to.q);
    std::copy_n(from.motion.v.data(), from.motion.v.size(), to.v);
    to.time = from.motion.time;
    to.status = from.status;
    to.steps = from.steps;
    to.rejected_steps = from.rejected_steps;
    to.energy_error = from.energy_error;
  }
  return is_done;
}

template <class Space>
MoveMembers* gauss_lanes(int stages) {
  switch (stages) {
    case 4:
      return &move_members<Space, GaussLanes<Space, 4>>;
#ifndef PENDULA_FEW_LANES  // where sanitizers make minutes of their compilation
    case 2:
      return &move_members<Space, GaussLanes<Space, 2>>;
    case 6:
      return &move_members<Space, GaussLanes<Space, 6>>;
    case 8:
      return &move_members<Space, GaussLanes<Space, 8>>;
#endif
    default:
      return nullptr;
  }
}

/// Queue<Method>: what moves members by an explicit method.
template <class Space, template <class> class Queue>
MoveMembers* explicit_lanes(Method method) {
  switch (method) {
    case Method::dopri5:
      return &move_members<Space, Queue<DormandPrince5>>;
#ifndef PENDULA_FEW_LANES
    case Method::rk4:
      return &move_members<Space, Queue<ClassicalRungeKutta>>;
    case Method::fehlberg78:
      return &move_members<Space, Queue<Fehlberg8>>;
#endif
    default:
      return nullptr;
  }
}

template <class Space>
struct LanesOf {
  template <class Method>
  using Plain = ExplicitLanes<Space, Method>;
  template <class Method>
  using WithTangent = TangentLanes<Space, Method>;
};

template <class Space>
MoveMembers* chain_lanes(const RunOptions& options) {
  if (options.method == Method::gauss) return gauss_lanes<Space>(options.stages);
  return explicit_lanes<Space, LanesOf<Space>::template Plain>(options.method);
}

template <class Space>
MoveMembers* tangent_lanes(const RunOptions& options) {
  return explicit_lanes<Space, LanesOf<Space>::template WithTangent>(options.method);
}

}  // namespace pendula
