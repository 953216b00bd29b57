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

/// Moves::by<Method>() of an explicit method, or Moves::by_series(); nullptr for other methods.
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

/// Moves::of<stages>() of Gauss steps; nullptr for numbers of stages that lanes were not compiled for.
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
