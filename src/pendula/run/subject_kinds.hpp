#pragma once

#include <pendula/chain/space.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/run/system_subject.hpp>
#include <stdexcept>

namespace pendula {

inline constexpr const char* sampled_has_no_derivatives =
    "feedback: expected a continuous one, got one with sample: its motion jumps, and has no derivatives here";

/// Calls act(subject) with what a subject is: a SystemSubject or a ChainSubject. Throws std::invalid_argument for one
/// with sampled feedback.
template <class Act>
auto as_its_kind(const Subject& subject, Act act) {
  if (const auto* system = dynamic_cast<const SystemSubject*>(&subject)) return act(*system);
  if (const auto* planar = dynamic_cast<const ChainSubject<Planar>*>(&subject)) return act(*planar);
  if (const auto* spatial = dynamic_cast<const ChainSubject<Spatial>*>(&subject)) return act(*spatial);
  throw std::invalid_argument(sampled_has_no_derivatives);
}

}  // namespace pendula
