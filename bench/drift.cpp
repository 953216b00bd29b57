// How energy drifts in space:  pendula_drift [STEPS [PARTS]]  prints one JSON object, the largest |ΔH| / Σ M g l of
// each part of the run, looked at every ten steps: of constant steps of two stages; and of the chaotic chain with four
// stages by steps of each kind, as many of them over about the same time.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/run/integrator.hpp>
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
  return pendula::Chain<Spatial>({.masses = Eigen::VectorXd::Ones(links), .lengths = Eigen::VectorXd::Ones(links)});
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

template <class Integrator>
std::vector<double> drift(const Case& run, Integrator& integrator, long steps, long parts) {
  pendula::Outcome outcome = integrator.start(run.start);
  const double energy = pendula::energy(run.chain, run.start), scale = pendula::energy_scale(run.chain);
  std::vector<double> largest(static_cast<std::size_t>(parts));
  for (long k = 0; k < steps && outcome; ++k) {
    outcome = integrator.step(run.step);
    if (k % 10 != 9) continue;
    double& worst = largest[static_cast<std::size_t>(k * parts / steps)];
    worst = std::max(worst, std::abs(pendula::energy(run.chain, integrator.state()) - energy) / scale);
  }
  if (!outcome) {
    std::cerr << "pendula_drift: " << run.name << ": " << outcome << '\n';
    std::exit(1);
  }
  return largest;
}

void print(const std::string& name, const std::vector<double>& errors) {
  std::cout << ",\n \"" << name << "\": [";
  const char* separator = "";
  for (const double error : errors) {
    std::cout << separator << error;
    separator = ", ";
  }
  std::cout << ']' << std::flush;
}

/// Of four stages, by the tolerance or of one size.
void print_steering(const std::string& name, Case run, const pendula::StepperOptions& options, double step, long steps,
                    long parts) {
  pendula::GaussStepper<pendula::ChainSolver<Spatial, 4>> stepper(run.chain, 4, options);
  run.step = step;
  const std::vector<double> errors = drift(run, stepper, steps, parts);
  print("steps " + name, errors);
  std::cerr << name << ": mean step " << stepper.time() / static_cast<double>(steps) << " s\n";
}

}  // namespace

int main(int argc, char** argv) {
  const long steps = argc > 1 ? std::atol(argv[1]) : 1'000'000;
  const long parts = argc > 2 ? std::atol(argv[2]) : 100;
  std::cout << "{\"steps\": " << steps;
  for (const Case& run : cases()) {
    const auto integrator = pendula::make_integrator(run.chain, {.stages = 2, .solver = pendula::Solver::chain});
    print(run.name, drift(run, *integrator, steps, parts));
  }
  const Case chaotic = cases().back();
  const double any = std::numeric_limits<double>::infinity();
  print_steering("by the last error", chaotic, {.tolerance = 1e-7, .steering = pendula::Steering::greedy}, any, steps,
                 parts);
  print_steering("symmetric", chaotic, {.tolerance = 1e-5}, any, steps, parts);
  print_steering("constant", chaotic, {}, 0.02, steps, parts);
  std::cout << "}\n";
}
