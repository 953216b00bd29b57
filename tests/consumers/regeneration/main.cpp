#include <cmath>
#include <iostream>
#include <pendula/kernels/planar_5.hpp>

#include "six.hpp"

using Five = pendula::kernels::Planar5;

// Unit links that hang: the bobs are 1, 2, … n below the pivot.
template <class Kernel>
typename Kernel::template Parameters<double> unit_chain() {
  typename Kernel::template Parameters<double> chain;
  chain.masses.setOnes();
  chain.lengths.setOnes();
  chain.damping.setZero();
  chain.gravity = 1;
  return chain;
}

int main() {
  const Five::Vector<double> q = Five::Vector<double>::Zero();
  double five = 0;
  Five::potential_energy(unit_chain<Five>(), q, five);
  const double six = height_of_six(unit_chain<Six>(), Six::Vector<double>::Zero());
  std::cout << "potential energies " << five << " and " << six << '\n';
  return five == -15 && six == -21 ? 0 : 1;
}
