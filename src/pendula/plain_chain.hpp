#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <pendula/chain.hpp>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {

/// A chain as plain numbers, which is how it crosses from a program to the compiled library (library.hpp). Everything
/// pointed at belongs to the caller.
struct PlainChain {
  struct Drive {
    int link;
    double amplitude[3];  ///< as many as the space's torques have components
    double frequency, phase;
  };

  int links;
  double gravity;
  const double* masses;   ///< (links)
  const double* lengths;  ///< (links)
  const double* damping;  ///< (links)
  const double* torque;   ///< constant torques link by link, (torque components x links)
  std::span<const Drive> drives;
};
static_assert(std::is_trivially_copyable_v<PlainChain> && std::is_standard_layout_v<PlainChain>);

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
