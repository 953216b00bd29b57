#include <cmath>
#include <iostream>

#include "chain.hpp"

// Unit links that hang: the bobs are 1, 2, … n below the pivot.
template <class Kernel>
double potential_energy_of_hanging_chain() {
  typename Kernel::template Parameters<double> chain;
  chain.masses.setOnes();
  chain.lengths.setOnes();
  chain.damping.setZero();
  chain.gravity = 1;
  const typename Kernel::template Vector<double> q = Kernel::template Vector<double>::Zero();
  double potential = 0;
  Kernel::potential_energy(chain, q, potential);
  return potential;
}

int main() {
  const Eigen::Vector2d bob = last_bob_after_ten_seconds();
  const Eigen::Vector2d expected(-1.0407657832461712, -1.7073476624693271);
  const double distance = (bob - expected).norm();
  std::cout << "last bob off by " << distance << '\n';
  return distance < 1e-12  // measured 1.7e-15
                 && potential_energy_of_hanging_chain<pendula::kernels::Planar3>() == -6 &&
                 potential_energy_of_hanging_chain<pendula::kernels::Planar5>() == -15
             ? 0
             : 1;
}
