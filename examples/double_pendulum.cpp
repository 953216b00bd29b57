// A double pendulum released from the horizontal, moved by two-stage Gauss–Legendre for ten seconds.
#include <pendula/kernels/planar_2.hpp>
#include <pendula/pendula.hpp>

#include <iostream>
#include <numbers>

int main() {
  using namespace pendula;
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector2d(1, 1);
  const Chain<Planar> chain(parameters);

  using Kernel = kernels::Planar2;
  GaussStepper<LagrangianSolver<>> stepper(system_of<Kernel>(chain), 2);
  Outcome outcome = stepper.start(State<Planar>::from_angles(Eigen::Vector2d::Constant(std::numbers::pi / 2)));
  for (int step = 0; outcome && step < 20000; ++step) outcome = stepper.step(5e-4);
  if (!outcome) {
    std::cerr << outcome << '\n';
    return 1;
  }
  std::cout << "last bob at " << bob_positions(chain, stepper.state()).col(1).transpose() << " m\n";
}
