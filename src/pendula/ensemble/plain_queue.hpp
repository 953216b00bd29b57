#pragma once

#include <cstdint>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/explicit/explicit_tableau.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/options.hpp>
#include <span>

namespace pendula::detail {

inline QueueOptions lane_options(const RunOptions& options, std::int64_t every) {
  QueueOptions asked;
  asked.step = is_adaptive(options) ? 0 : options.step;
  asked.tolerance = options.tolerance;
  asked.energy_every = every;
  // If fixed points are asked for, they go to round-off, as in `simulate`.
  if (options.iteration == Iteration::fixed_point) asked.enough = MembersStepperOptions{}.enough;
  return asked;
}

/// Moves members by a MemberQueue: MoveMembers and MoveSystemMembers.
template <class Queue>
bool move_by(typename Queue::Subject subject, const RunOptions& options, std::int64_t every,
             std::span<const typename Queue::MemberType> members, std::span<MemberEnd> ends, MemberWatch& watch) {
  Queue queue(subject, lane_options(options, every));
  queue.set_watch(watch);
  return queue.run(members, ends);
}

/// Moves::of<stages>() for Gauss steps, Moves::by<Method>() for an explicit method, or Moves::by_series(); nullptr if
/// lanes are not compiled for the options.
template <class Moves>
auto lanes_of(const RunOptions& options) -> decltype(Moves::template of<4>()) {
  switch (options.method) {
    case Method::gauss:
      if (options.stages == 4) return Moves::template of<4>();
#ifndef PENDULA_FEW_LANES  // where sanitizers make minutes of their compilation
      if (options.stages == 8) return Moves::template of<8>();
#endif
      return nullptr;
    case Method::fehlberg78:
      return Moves::template by<Fehlberg8>();
    case Method::taylor:
      return Moves::by_series();
    default:
      return nullptr;
  }
}

}  // namespace pendula::detail
