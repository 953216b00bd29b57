#pragma once

#include <Eigen/Core>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/state.hpp>
#include <random>

namespace pendula::test {

/// Seeded draws; the same on every machine, because only the generator is the standard library's.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / static_cast<double>(std::mt19937::max()));
  }

  template <class Matrix>
  Matrix matrix(Eigen::Index rows, Eigen::Index cols, double low, double high) {
    Matrix values(rows, cols);
    for (Eigen::Index j = 0; j < cols; ++j) {
      for (Eigen::Index i = 0; i < rows; ++i) values(i, j) = uniform(low, high);
    }
    return values;
  }

 private:
  std::mt19937 engine_;
};

/// Masses and lengths between ½ and 2; damping and constant torques where asked for.
template <class Space>
Chain<Space> random_chain(Random& random, int links, bool loaded = false) {
  ChainParameters<Space> parameters;
  parameters.masses = random.matrix<Eigen::VectorXd>(links, 1, 0.5, 2);
  parameters.lengths = random.matrix<Eigen::VectorXd>(links, 1, 0.5, 2);
  if (loaded) {
    parameters.damping = random.matrix<Eigen::VectorXd>(links, 1, 0.1, 1);
    parameters.torque = random.matrix<Torque<Space, Eigen::Dynamic>>(Space::torque_components, links, -2, 2);
  }
  return Chain<Space>(parameters);
}

/// A random chain with damping, constant torques, and a drive on its last link.
template <class Space>
Chain<Space> driven_chain(Random& random, int links) {
  const Chain<Space> loaded = random_chain<Space>(random, links, true);
  ChainParameters<Space> parameters{loaded.masses(),  loaded.lengths(),         9.81,
                                    loaded.damping(), loaded.constant_torque(), {}};
  Drive<Space> drive;
  drive.link = links - 1;
  drive.amplitude.setConstant(0.7);
  drive.frequency = 5;
  drive.phase = 0.3;
  parameters.drives = {drive};
  return Chain<Space>(parameters);
}

/// Angles away from the pole (|sin θ| > ½) and rates up to 1 rad/s.
template <class Space>
State<Space> random_state(Random& random, int links) {
  State<Space> state;
  state.q = random.matrix<Eigen::VectorXd>(Space::dof * links, 1, 0.6, 2.5);
  state.v = random.matrix<Eigen::VectorXd>(Space::dof * links, 1, -1, 1);
  return state;
}

/// Equal links of unit mass.
template <class Space>
Chain<Space> equal_chain(int links, double gravity = 9.81, double length = 1) {
  ChainParameters<Space> parameters;
  parameters.masses = Eigen::VectorXd::Ones(links);
  parameters.lengths = Eigen::VectorXd::Constant(links, length);
  parameters.gravity = gravity;
  return Chain<Space>(parameters);
}

}  // namespace pendula::test
