// How heavy is the second bob? A double pendulum was let go and looked at two seconds later. Two thousand others, with
// masses drawn at random, tell which masses would have led there.
#include <pendula/pendula.hpp>

#include <cmath>
#include <iostream>
#include <memory>
#include <random>
#include <vector>

using namespace pendula;

namespace {

EnsembleMember with_mass(double mass) {
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::Vector2d(1, mass);
  parameters.lengths = Eigen::Vector2d(1, 0.8);
  const Chain<Planar> chain(parameters);
  return {std::make_shared<ChainSubject<Planar>>(chain), State<Planar>::from_angles(Eigen::Vector2d(1.2, 0.4))};
}

}  // namespace

int main() {
  constexpr double seen_1 = -0.212, seen_2 = 0.519, error = 0.003;  // rad, after two seconds
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.2, 2);
  std::vector<double> masses(2000), likelihoods(masses.size());
  std::vector<EnsembleMember> members;
  for (double& mass : masses) members.push_back(with_mass(mass = uniform(random)));

  EnsembleSchedule schedule;
  schedule.options.step = 0;  // of its own choice
  schedule.options.stages = 6;
  schedule.options.tolerance = 1e-8;
  schedule.duration = 2;
  schedule.threads = 2;
  propagate(members, schedule, [&](std::size_t number, const RunReport& report) {
    if (report.end != RunEnd::complete) return;
    const double off = std::hypot(report.last.q[0] - seen_1, report.last.q[1] - seen_2) / error;
    likelihoods[number] = std::exp(-off * off / 2);
  });

  double sum = 0, mean = 0, square = 0;
  for (std::size_t k = 0; k < masses.size(); ++k) {
    sum += likelihoods[k];
    mean += likelihoods[k] * masses[k];
    square += likelihoods[k] * masses[k] * masses[k];
  }
  mean /= sum;
  std::cout << "mass " << mean << " +- " << std::sqrt(square / sum - mean * mean) << " kg\n";
}
