#pragma once

#include <cstddef>
#include <cstdint>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/ensemble/member_ends.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>
#include <vector>

namespace pendula::test {

/// A member of an ensemble, with its start.
template <class Space, int N = Eigen::Dynamic>
struct ChainMember {
  Motion start;
  double end = 0;
  const Chain<Space, N>* chain = nullptr;  ///< where it has its own
};
struct SystemMember {
  Motion start;
  double end = 0;
  PlainSystem system;
};

/// As a queue takes them, of chains that nothing drives; `chain` and `members` must outlive it.
template <class Space, int N>
std::vector<PlainMember<PlainChain>> plain_members(const Chain<Space, N>& chain,
                                                   const std::vector<ChainMember<Space, N>>& members) {
  std::vector<PlainMember<PlainChain>> plain_ones;
  for (const auto& [start, end, own] : members) {
    plain_ones.push_back({plain(own == nullptr ? chain : *own, {}), start.time, end, start.q.data(), start.v.data()});
  }
  return plain_ones;
}
inline std::vector<PlainMember<PlainSystem>> plain_members(const std::vector<SystemMember>& members) {
  std::vector<PlainMember<PlainSystem>> plain_ones;
  for (const auto& [start, end, system] : members) {
    plain_ones.push_back({system, start.time, end, start.q.data(), start.v.data()});
  }
  return plain_ones;
}

/// What became of a member.
struct ReachedEnd {
  Motion motion;
  Status status;
  std::int64_t steps;
  double energy_error, energy_sum;
};

template <class Queue, class Model>
std::vector<ReachedEnd> ends_by(Queue& queue, Eigen::Index coordinates,
                                const std::vector<PlainMember<Model>>& members) {
  MemberEnds ends(coordinates, members.size());
  queue.run(members, ends.all());
  std::vector<ReachedEnd> reached;
  for (std::size_t k = 0; k < members.size(); ++k) {
    const MemberEnd& end = ends.end(k);
    reached.push_back({ends.motion(k), end.status, end.steps, end.energy_error, end.energy_sum});
  }
  return reached;
}

}  // namespace pendula::test
