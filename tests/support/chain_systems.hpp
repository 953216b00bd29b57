#pragma once

#include <cstddef>
#include <pendula/chain/chain_numbers.hpp>
#include <vector>

#include "support/members.hpp"
#include "support/random_chain.hpp"

namespace pendula::test {

/// Random chains as systems, with damping and drives where they are loaded.
struct ChainSystems {
  ChainSystems(std::size_t count, bool loaded, double end) {
    Random random(17);
    for (std::size_t k = 0; k < count; ++k) {
      Chain<Planar> chain = random_chain<Planar>(random, 2, loaded);
      if (loaded) chain = driven(chain, 1 + k % 3);
      chains.push_back(chain);
    }
    for (const Chain<Planar>& chain : chains) {
      drives.push_back(plain_drives(chain));
      numbers.emplace_back(plain(chain, drives.back()), 1);
    }
    for (const ChainSystem& system : numbers) {
      const State<Planar> state = random_state<Planar>(random, 2);
      members.push_back({Motion(0.25, state.q, state.v), end, system.plain()});
    }
  }

  // By one to three sines, so that members differ in that.
  static Chain<Planar> driven(const Chain<Planar>& chain, std::size_t sines) {
    ChainParameters<Planar> parameters;
    parameters.masses = chain.masses();
    parameters.lengths = chain.lengths();
    parameters.gravity = chain.gravity();
    parameters.damping = chain.damping();
    parameters.torque = chain.constant_torque();
    for (std::size_t k = 0; k < sines; ++k) {
      Drive<Planar> drive{static_cast<int>(k % 2), {}, 3.0 + static_cast<double>(k), 0.4};
      drive.amplitude[0] = 0.7;
      parameters.drives.push_back(drive);
    }
    return Chain<Planar>(std::move(parameters));
  }

  std::vector<Chain<Planar>> chains;
  std::vector<std::vector<PlainChain::Drive>> drives;
  std::vector<ChainSystem> numbers;
  std::vector<SystemMember> members;
};

}  // namespace pendula::test
