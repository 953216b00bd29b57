// How heavy is the second bob? A double pendulum was let go and looked at two seconds later. Two thousand others, with
// masses drawn at random, tell which masses would have led there.
#include <pendula/pendula.hpp>

#include <cmath>
#include <iostream>
#include <random>
#include <vector>

using namespace pendula;

int main() {
  constexpr double seen_1 = -0.212, seen_2 = 0.519, error = 0.003;  // rad, after two seconds
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.2, 2);
  std::vector<double> masses(2000);
  std::vector<Model> models;
  for (double& mass : masses) {
    mass = uniform(random);
    models.emplace_back(Chain<Planar>({.masses = Eigen::Vector2d(1, mass), .lengths = Eigen::Vector2d(1, 0.8)}));
  }

  Eigen::MatrixXd starts(masses.size(), 2);
  starts.rowwise() = Eigen::RowVector2d(1.2, 0.4);
  const Ends ends = propagate(models, starts, {.duration = 2, .run = {.stages = 6, .tolerance = 1e-8}, .threads = 2});

  double sum = 0, mean = 0, square = 0;
  for (std::size_t k = 0; k < masses.size(); ++k) {
    if (ends.how[k] != PENDULA_OK) continue;
    const auto member = static_cast<Eigen::Index>(k);
    const double off = std::hypot(ends.q(member, 0) - seen_1, ends.q(member, 1) - seen_2) / error;
    const double likelihood = std::exp(-off * off / 2);
    sum += likelihood;
    mean += likelihood * masses[k];
    square += likelihood * masses[k] * masses[k];
  }
  mean /= sum;
  std::cout << "mass " << mean << " +- " << std::sqrt(square / sum - mean * mean) << " kg\n";
}
