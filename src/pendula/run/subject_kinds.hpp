#pragma once

#include <pendula/chain/space.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/run/system_subject.hpp>

namespace pendula {

/// Calls act(subject) with what a subject is: a SystemSubject or a ChainSubject.
template <class Act>
auto as_its_kind(const Subject& subject, Act act) {
  if (const auto* system = dynamic_cast<const SystemSubject*>(&subject)) return act(*system);
  if (const auto* planar = dynamic_cast<const ChainSubject<Planar>*>(&subject)) return act(*planar);
  return act(dynamic_cast<const ChainSubject<Spatial>&>(subject));
}

}  // namespace pendula
