#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/plain_chain.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// A chain's sinusoidal torques as plain numbers.
template <class Space>
std::vector<PlainChain::Drive> plain_drives(const Chain<Space>& chain) {
  std::vector<PlainChain::Drive> drives;
  for (const Drive<Space>& drive : chain.drives()) {
    PlainChain::Drive plain{drive.link, {}, drive.frequency, drive.phase};
    std::copy_n(drive.amplitude.data(), Space::torque_components, plain.amplitude);
    drives.push_back(plain);
  }
  return drives;
}

/// `chain` as plain numbers, which live as long as it and `drives`.
template <class Space>
PlainChain plain(const Chain<Space>& chain, std::span<const PlainChain::Drive> drives) {
  return {chain.links(),
          chain.gravity(),
          chain.masses().data(),
          chain.lengths().data(),
          chain.damping().data(),
          chain.constant_torque().data(),
          drives};
}

/// The chain that `plain` was made from.
template <class Space>
Chain<Space> chain_of(const PlainChain& plain) {
  const auto numbers = [&](const double* values) { return Eigen::Map<const Eigen::VectorXd>(values, plain.links); };
  using PlainTorque = Eigen::Map<const Torque<Space, Eigen::Dynamic>>;
  ChainParameters<Space> parameters;
  parameters.masses = numbers(plain.masses);
  parameters.lengths = numbers(plain.lengths);
  parameters.gravity = plain.gravity;
  parameters.damping = numbers(plain.damping);
  parameters.torque = PlainTorque(plain.torque, Space::torque_components, plain.links);
  for (const PlainChain::Drive& from : plain.drives) {
    Drive<Space> drive{from.link, {}, from.frequency, from.phase};
    std::copy_n(from.amplitude, Space::torque_components, drive.amplitude.data());
    parameters.drives.push_back(drive);
  }
  return Chain<Space>(std::move(parameters));
}

}  // namespace pendula
