// How energy drifts in space:  pendula_drift [STEPS [PARTS]]  prints one JSON object, the largest |ΔH| / Σ M g l of
// each part of the run. Two stages; looked at every ten steps.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <pendula/pendula.hpp>
#include <string>
#include <vector>

namespace {

using pendula::Spatial;

struct Case {
  std::string name;
  pendula::Chain<Spatial> chain;
  pendula::State<Spatial> start;
  double step;
};

pendula::Chain<Spatial> equal_chain(int links) {
  return pendula::Chain<Spatial>(
      {.masses = Eigen::VectorXd::Ones(links), .lengths = Eigen::VectorXd::Ones(links), .drives = {}});
}

std::vector<Case> cases() {
  const auto angle = [](double x) { return Eigen::VectorXd::Constant(1, x); };
  const auto tumbling = pendula::State<Spatial>::from_angles(angle(2), angle(0), angle(4), angle(2));
  const auto chaotic =
      pendula::State<Spatial>::from_angles(Eigen::Vector3d(1.4, 0.6, 1.0), Eigen::Vector3d(0.3, 1.0, -0.5),
                                           Eigen::Vector3d(0.3, -0.2, 0.4), Eigen::Vector3d(0.5, 0.8, -0.3));
  return {{"one link tumbling, h = 0.01 s", equal_chain(1), tumbling, 0.01},
          {"three links, chaotic, h = 0.01 s", equal_chain(3), chaotic, 0.01},
          {"three links, chaotic, h = 0.001 s", equal_chain(3), chaotic, 0.001}};
}

std::vector<double> drift(const Case& run, long steps, long parts) {
  const auto integrator = pendula::make_integrator(run.chain, {.stages = 2, .solver = pendula::Solver::chain});
  pendula::Outcome outcome = integrator->start(run.start);
  const double energy = pendula::energy(run.chain, run.start), scale = pendula::energy_scale(run.chain);
  std::vector<double> largest(static_cast<std::size_t>(parts));
  for (long k = 0; k < steps && outcome; ++k) {
    outcome = integrator->step(run.step);
    if (k % 10 != 9) continue;
    double& worst = largest[static_cast<std::size_t>(k * parts / steps)];
    worst = std::max(worst, std::abs(pendula::energy(run.chain, integrator->state()) - energy) / scale);
  }
  if (!outcome) {
    std::cerr << "pendula_drift: " << run.name << ": " << outcome << '\n';
    std::exit(1);
  }
  return largest;
}

}  // namespace

int main(int argc, char** argv) {
  const long steps = argc > 1 ? std::atol(argv[1]) : 1'000'000;
  const long parts = argc > 2 ? std::atol(argv[2]) : 100;
  std::cout << "{\"steps\": " << steps;
  for (const Case& run : cases()) {
    std::cout << ",\n \"" << run.name << "\": [";
    const char* separator = "";
    for (double error : drift(run, steps, parts)) {
      std::cout << separator << error;
      separator = ", ";
    }
    std::cout << ']' << std::flush;
  }
  std::cout << "}\n";
}
