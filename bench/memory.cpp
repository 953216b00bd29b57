// Peak memory of a whole program that moves a long chain:  pendula_memory [LINKS [STAGES]]  prints one JSON object.
#include <sys/resource.h>

#include <cstdlib>
#include <iostream>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/run/integrator.hpp>

namespace {

/// Largest resident set of this process so far  [MiB].
double peak_mebibytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace

int main(int argc, char** argv) {
  using pendula::Planar;
  const int links = argc > 1 ? std::atoi(argv[1]) : 100'000;
  const int stages = argc > 2 ? std::atoi(argv[2]) : 2;
  const double before = peak_mebibytes();
  const pendula::Chain<Planar> chain(
      {.masses = Eigen::VectorXd::Constant(links, 1.), .lengths = Eigen::VectorXd::Constant(links, 1. / links)});
  const auto integrator = pendula::make_integrator(
      chain, {.stages = stages, .solver = pendula::Solver::chain, .iteration = pendula::Iteration::newton});
  auto outcome = integrator->start(pendula::State<Planar>::from_angles(Eigen::VectorXd::Constant(links, 1.5)));
  for (int k = 0; k < 5 && outcome; ++k) outcome = integrator->step(0.05 / links);
  if (!outcome) std::cerr << "pendula_memory: " << outcome << '\n';
  std::cout << "{\"links\": " << links << ", \"stages\": " << stages << ", \"peak_mebibytes\": " << peak_mebibytes()
            << ", \"empty_program_mebibytes\": " << before << "}\n";
  return outcome ? 0 : 1;
}
