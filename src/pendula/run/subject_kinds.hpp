#pragma once

#include <memory>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/space.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/no_kernel.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/system_model.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace pendula {

inline constexpr const char* sampled_has_no_derivatives =
    "feedback: expected a continuous one, got one with sample: its motion jumps, and has no derivatives here";

inline constexpr const char* signals_are_not_here =
    "signal: expected a system without signals, got one with: here a program holds inputs itself, from step to step";

inline constexpr const char* held_end_is_not_here =
    "chain.end: expected a chain that hangs free, got one whose last bob is held: for its linearization take the model "
    "hanging_chain";

/// Calls act(subject) with what a subject is: a SystemSubject or a ChainSubject. Throws std::invalid_argument for one
/// with sampled feedback or signals.
template <class Act>
auto as_its_kind(const Subject& subject, Act act) {
  if (const auto* system = dynamic_cast<const SystemSubject*>(&subject)) return act(*system);
  if (const auto* planar = dynamic_cast<const ChainSubject<Planar>*>(&subject)) return act(*planar);
  if (const auto* spatial = dynamic_cast<const ChainSubject<Spatial>*>(&subject)) return act(*spatial);
  throw std::invalid_argument(subject.part_at(0) ? signals_are_not_here : sampled_has_no_derivatives);
}

/// The same, with Subject::part_at the time in place of a subject that has one.
template <class Act>
auto as_its_kind_at(const Subject& subject, double time, Act act) {
  const std::shared_ptr<const Subject> part = subject.part_at(time);
  return as_its_kind(part ? *part : subject, act);
}

/// The system that the dense solver moves a chain as. Throws NoKernel.
template <class Space>
SystemModel system_model_of(const ChainSubject<Space>& subject) {
  const Chain<Space>& chain = subject.chain();
  if (chain.is_held()) throw std::invalid_argument(held_end_is_not_here);
  for (const SystemTable* kernel : library<KernelList<Space>>().tables) {
    if (kernel->info.links != chain.links()) continue;
    const std::vector<PlainChain::Drive> drives = plain_drives(chain);
    return {*kernel, ChainSystem(plain(chain, drives), Space::torque_components).plain()};
  }
  throw NoKernel("no kernel for a " + std::string(Space::name) + " chain of " + std::to_string(chain.links()) +
                 " links in this build; its linearization needs one");
}

inline SystemModel system_model_of(const SystemSubject& subject) {
  return {subject.table(), subject.numbers().plain()};
}

/// The system of a subject. Functions of several pieces are on the pieces that `motion` takes.
inline SystemModel system_model_of(const SystemSubject& subject, const Motion& motion) {
  return {subject.table(), subject.numbers_at(motion).plain()};
}
template <class Space>
SystemModel system_model_of(const ChainSubject<Space>& subject, const Motion& /*motion*/) {
  return system_model_of(subject);
}

}  // namespace pendula
