#include "six.hpp"

double height_of_six(const Six::Parameters<double>& chain, const Six::Vector<double>& q) {
  double potential = 0;
  Six::potential_energy(chain, q, potential);
  return potential;
}
