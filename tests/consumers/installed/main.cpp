// Four links in space, released at rest in a vertical plane, move as the planar chain does: the kernel made in this
// project's build and the library's own must agree.
#include <cmath>
#include <iostream>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/kernels/spatial_4.hpp>
#include <pendula/pendula.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/schedule.hpp>
#include <stdexcept>

using namespace pendula;

namespace {

constexpr double step = 1e-3, duration = 0.2, azimuth = 0.3;

template <class Space>
Chain<Space> unit_chain(int links) {
  ChainParameters<Space> parameters;
  parameters.masses.setOnes(links);
  parameters.lengths.setOnes(links);
  return Chain<Space>(parameters);
}

// Compiled here, over this project's own kernel, with the number of stages known.
Eigen::Vector3d last_bob_in_space(const Eigen::VectorXd& theta) {
  const auto chain = unit_chain<Spatial>(4);
  GaussStepper<LagrangianSolver<4>> stepper(system_of<kernels::Spatial4>(chain), 2);
  const Eigen::VectorXd phi = Eigen::VectorXd::Constant(4, azimuth);
  for (auto outcome = stepper.start(State<Spatial>::from_angles(theta, phi)); stepper.time() < duration - step / 2;) {
    if (outcome) outcome = stepper.step(step);
    if (!outcome) throw std::runtime_error(message(outcome));
  }
  return bob_positions(chain, stepper.state()).col(3);
}

// From the compiled library.
Eigen::Vector2d last_bob_in_plane(const Eigen::VectorXd& theta) {
  const auto chain = unit_chain<Planar>(4);
  const auto integrator = make_integrator(chain, RunOptions{});
  const auto result =
      simulate(*integrator, State<Planar>::from_angles(theta), {step, duration, 1000}, [](const auto&) {});
  if (!result.outcome) throw std::runtime_error(message(result.outcome));
  return bob_positions(chain, integrator->state()).col(3);
}

bool near(const char* what, double got, double expected, double tolerance) {
  std::cout << what << ": " << got << ", expected " << expected << ", off by " << std::abs(got - expected) << '\n';
  return std::abs(got - expected) < tolerance;
}

// Joules with m = l = g = 1, hanging: the bobs are 1 and 2 below the pivot.
double height_of_double_pendulum() {
  using Kernel = kernels::Planar2;
  const Kernel::Parameters<double> chain{Eigen::Vector2d::Ones(), Eigen::Vector2d::Ones(), Eigen::Vector2d::Zero(), 1};
  const Kernel::Vector<double> q = Kernel::Vector<double>::Zero();
  double potential = 0;
  Kernel::potential_energy(chain, q, potential);
  return potential;
}

}  // namespace

int main() {
  const Eigen::VectorXd theta = Eigen::VectorXd::LinSpaced(4, 2.0, 1.4);
  const Eigen::Vector3d space = last_bob_in_space(theta);
  const Eigen::Vector2d plane = last_bob_in_plane(theta);
  std::cout.precision(16);
  bool good = near("x", space.x(), plane.x() * std::cos(azimuth), 1e-13);           // measured 0
  good = near("y", space.y(), plane.x() * std::sin(azimuth), 1e-13) && good;        // measured 0
  good = near("z", space.z(), plane.y(), 1e-13) && good;                            // measured 0
  good = near("potential energy", height_of_double_pendulum(), -3, 1e-14) && good;  // measured 0
  return good ? 0 : 1;
}
