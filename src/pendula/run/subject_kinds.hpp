#pragma once

#include <memory>
#include <pendula/chain/space.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/run/system_subject.hpp>
#include <stdexcept>

namespace pendula {

inline constexpr const char* sampled_has_no_derivatives =
    "feedback: expected a continuous one, got one with sample: its motion jumps, and has no derivatives here";

inline constexpr const char* signals_are_not_here =
    "signal: expected a system without signals, got one with: here a program holds inputs itself, from step to step";

/// Calls act(subject) with what a subject is: a SystemSubject or a ChainSubject. Throws std::invalid_argument for one
/// with sampled feedback or signals.
template <class Act>
auto as_its_kind(const Subject& subject, Act act) {
  if (const auto* system = dynamic_cast<const SystemSubject*>(&subject)) return act(*system);
  if (const auto* planar = dynamic_cast<const ChainSubject<Planar>*>(&subject)) return act(*planar);
  if (const auto* spatial = dynamic_cast<const ChainSubject<Spatial>*>(&subject)) return act(*spatial);
  throw std::invalid_argument(subject.part_at(0) ? signals_are_not_here : sampled_has_no_derivatives);
}

/// The same with the subject that moves it around a time (Subject::part_at).
template <class Act>
auto as_its_kind_at(const Subject& subject, double time, Act act) {
  const std::shared_ptr<const Subject> part = subject.part_at(time);
  return as_its_kind(part ? *part : subject, act);
}

}  // namespace pendula
