#pragma once

// One motion, moved by the compiled library.
#include <iostream>
#include <memory>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/schedule.hpp>
#include <stdexcept>
#include <string>
#include <vector>

using namespace pendula;

inline constexpr double step = 2e-3, duration = 0.1;

template <class Space>
Chain<Space> loaded_chain() {
  ChainParameters<Space> parameters;
  parameters.masses = Eigen::Vector3d(1.0, 0.5, 2.0);
  parameters.lengths = Eigen::Vector3d(1.0, 2.0, 0.5);
  parameters.damping = Eigen::Vector3d(0.1, 0.2, 0.3);
  parameters.torque = Torque<Space, Eigen::Dynamic>::Constant(Space::torque_components, 3, 0.25);
  Drive<Space> drive;
  drive.link = 1;
  drive.amplitude.setConstant(0.5);
  drive.frequency = 3;
  parameters.drives.assign(5, drive);
  return Chain<Space>(parameters);
}

template <class Space>
State<Space> start() {
  if constexpr (Space::dof == 1) {
    return State<Space>::from_angles(Eigen::Vector3d(1.0, 0.8, 0.6), Eigen::Vector3d(0.1, 0.2, 0.3));
  } else {
    return State<Space>::from_angles(Eigen::Vector3d(1.0, 0.8, 0.6), Eigen::Vector3d(0.1, 0.2, 0.3));
  }
}

// States go both ways in every row, and are kept and freed here.
template <class Space>
State<Space> end_of_run(Integrator& integrator) {
  std::vector<State<Space>> rows;
  const auto result = simulate(integrator, start<Space>(), {step, duration, 1},
                               [&](const State<Space>& state) { rows.push_back(state); });
  if (!result.outcome) throw std::runtime_error(message(result.outcome));
  return rows.back();
}

template <class Space>
State<Space> by_library(const RunOptions& options) {
  return end_of_run<Space>(*make_integrator(loaded_chain<Space>(), options));
}

template <class Space>
bool same(const std::string& what, const State<Space>& a, const State<Space>& b) {
  const double difference = (a.q - b.q).cwiseAbs().maxCoeff() + (a.v - b.v).cwiseAbs().maxCoeff();
  const bool good = difference < 1e-13;  // measured 9e-16
  std::cout << what << " differ by " << difference << (good ? "" : ": WRONG") << '\n';
  return good;
}
