#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/explicit/explicit_tableau.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/options.hpp>
#include <span>
#include <vector>

namespace pendula::detail {

inline QueueOptions lane_options(const RunOptions& options, std::int64_t every) {
  QueueOptions asked;
  asked.step = is_adaptive(options) ? 0 : options.step;
  asked.tolerance = options.tolerance;
  asked.energy_every = every;
  // Who asks for the iteration of lanes has one that `simulate` takes as well, to round-off.
  if (options.iteration == Iteration::fixed_point) asked.enough = MembersStepperOptions{}.enough;
  return asked;
}

inline void tell_ends(std::span<const MemberEnd> reached, std::span<PlainMemberEnd> ends) {
  for (std::size_t k = 0; k < reached.size(); ++k) {
    const MemberEnd& from = reached[k];
    PlainMemberEnd& to = ends[k];
    std::copy_n(from.motion.q.data(), from.motion.q.size(), to.q);
    std::copy_n(from.motion.v.data(), from.motion.v.size(), to.v);
    to.time = from.motion.time;
    to.status = from.status;
    to.steps = from.steps;
    to.rejected_steps = from.rejected_steps;
    to.energy_error = from.energy_error;
    to.energy_sum = from.energy_sum;
  }
}

/// Moves members by a Queue, as MoveMembers and MoveSystemMembers tell.
template <class Queue>
bool move_plainly(typename Queue::Common common, const RunOptions& options, std::int64_t every,
                  std::span<const typename Queue::Member> members, std::span<PlainMemberEnd> ends, MemberWatch& watch) {
  Queue queue(common, lane_options(options, every));
  queue.set_watch(watch);
  std::vector<MemberEnd> reached(members.size());
  const bool is_done = queue.run(members, reached);
  tell_ends(reached, ends);
  return is_done;
}

/// What moves members by an explicit method, of Moves::by<Method>() and Moves::by_series(); nullptr for others.
template <class Moves>
auto explicit_lanes(Method method) -> decltype(Moves::template by<DormandPrince5>()) {
  switch (method) {
    case Method::dopri5:
      return Moves::template by<DormandPrince5>();
    case Method::taylor:
      return Moves::by_series();
#ifndef PENDULA_FEW_LANES  // where sanitizers make minutes of their compilation
    case Method::rk4:
      return Moves::template by<ClassicalRungeKutta>();
    case Method::fehlberg78:
      return Moves::template by<Fehlberg8>();
#endif
    default:
      return nullptr;
  }
}

/// What moves members by Gauss steps, of Moves::of<stages>(); nullptr for other numbers of stages.
template <class Moves>
auto gauss_lanes(int stages) -> decltype(Moves::template of<4>()) {
  switch (stages) {
    case 4:
      return Moves::template of<4>();
#ifndef PENDULA_FEW_LANES
    case 2:
      return Moves::template of<2>();
    case 6:
      return Moves::template of<6>();
    case 8:
      return Moves::template of<8>();
#endif
    default:
      return nullptr;
  }
}

/// Either of them.
template <class Moves>
auto lanes_of(const RunOptions& options) -> decltype(Moves::template of<4>()) {
  if (options.method == Method::gauss) return gauss_lanes<Moves>(options.stages);
  return explicit_lanes<Moves>(options.method);
}

}  // namespace pendula::detail
