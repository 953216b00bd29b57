#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/system/kernel_table.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {

/// A chain's sinusoidal torques as plain numbers.
template <class Space, int N>
std::vector<PlainChain::Drive> plain_drives(const Chain<Space, N>& chain) {
  std::vector<PlainChain::Drive> drives;
  for (const Drive<Space>& drive : chain.drives()) {
    PlainChain::Drive plain{drive.link, {}, drive.frequency, drive.phase};
    std::copy_n(drive.amplitude.data(), Space::torque_components, plain.amplitude);
    drives.push_back(plain);
  }
  return drives;
}

/// `chain` as plain numbers. They are valid as long as `chain` and `drives`.
template <class Space, int N>
PlainChain plain(const Chain<Space, N>& chain, std::span<const PlainChain::Drive> drives) {
  return {chain.links(),
          chain.gravity(),
          chain.masses().data(),
          chain.lengths().data(),
          chain.damping().data(),
          chain.constant_torque().data(),
          drives,
          chain.end() ? &*chain.end() : nullptr};
}

/// The chain that `plain` was made from. It must have N links, unless N is Eigen::Dynamic.
template <class Space, int N = Eigen::Dynamic>
Chain<Space, N> chain_of(const PlainChain& plain) {
  const auto numbers = [&](const double* values) { return Eigen::Map<const Eigen::VectorXd>(values, plain.links); };
  using PlainTorque = Eigen::Map<const Torque<Space, Eigen::Dynamic>>;
  ChainParameters<Space, N> parameters;
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
  if (plain.end != nullptr) parameters.end = *plain.end;
  return Chain<Space, N>(std::move(parameters));
}

/// A chain's numbers as a generated kernel takes them: masses, lengths, damping and gravity are its parameters, the
/// components of the torques its inputs.
class ChainSystem {
 public:
  ChainSystem(const PlainChain& chain, int torque_components)
      : inputs_(chain.torque, chain.torque + chain.links * torque_components) {
    for (const double* numbers : {chain.masses, chain.lengths, chain.damping}) {
      parameters_.insert(parameters_.end(), numbers, numbers + chain.links);
    }
    parameters_.push_back(chain.gravity);
    for (const PlainChain::Drive& drive : chain.drives) {
      for (int k = 0; k < torque_components; ++k) {
        if (drive.amplitude[k] == 0) continue;
        sines_.push_back({drive.link * torque_components + k, drive.amplitude[k], drive.frequency, drive.phase});
      }
    }
  }

  /// Valid as long as this object.
  PlainSystem plain() const { return {parameters_.data(), inputs_.data(), sines_}; }

 private:
  std::vector<double> parameters_, inputs_;
  std::vector<InputSine> sines_;
};

/// The space of a chain's generated kernel.
template <class Kernel>
using SpaceOf = std::conditional_t<Kernel::dof == 1, Planar, Spatial>;

/// A chain as a system of a generated kernel. Throws std::invalid_argument if the kernel is for another number of
/// links.
template <class Kernel, class Space, int N>
SystemModel system_of(const Chain<Space, N>& chain) {
  if (chain.links() != Kernel::links) {
    throw std::invalid_argument("kernel " + std::string(Kernel::name) + ": expected a chain of " +
                                std::to_string(Kernel::links) + " links, got " + std::to_string(chain.links()));
  }
  const std::vector<PlainChain::Drive> drives = plain_drives(chain);
  return SystemModel(system_table<Kernel>, ChainSystem(plain(chain, drives), Space::torque_components).plain());
}

}  // namespace pendula
