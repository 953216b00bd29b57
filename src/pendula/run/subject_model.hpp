#pragma once

#include <pendula/chain/chain_numbers.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/no_kernel.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <pendula/system/system_model.hpp>
#include <string>
#include <vector>

namespace pendula {

/// The system that the dense solver moves a chain as. Throws NoKernel.
template <class Space>
SystemModel system_model_of(const ChainSubject<Space>& subject) {
  const Chain<Space>& chain = subject.chain();
  for (const SystemTable* kernel : library_of<Space>().kernels) {
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

/// Of a subject with functions of several pieces by those that a motion takes.
inline SystemModel system_model_of(const SystemSubject& subject, const Motion& motion) {
  return {subject.table(), subject.numbers_at(motion).plain()};
}
template <class Space>
SystemModel system_model_of(const ChainSubject<Space>& subject, const Motion& /*motion*/) {
  return system_model_of(subject);
}

}  // namespace pendula
