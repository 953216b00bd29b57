// Truths that know nothing of this code: elliptic periods, cones, Laguerre modes, symmetries.

#include <Eigen/Eigenvalues>
#include <cmath>

#include "support/kernels.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

State<Planar> planar(std::initializer_list<double> theta) {
  Eigen::VectorXd angles(static_cast<Eigen::Index>(theta.size()));
  std::copy(theta.begin(), theta.end(), angles.begin());
  return State<Planar>::from_angles(angles);
}

TEST(OnePendulum, HasTheEllipticPeriod) {
  const double gravity = 9.81, start = 2.5;
  const double period = 4 * std::sqrt(1 / gravity) * std::comp_ellint_1(std::sin(start / 2));
  const State<Planar> end =
      final_state(equal_chain<Planar>(1, gravity), planar({start}), gauss(6), period / 200, period);
  EXPECT_NEAR(end.q[0], start, 1e-14);  // measured 0
  EXPECT_NEAR(end.v[0], 0, 5e-14);      // measured 4e-15
}

TEST(OnePendulum, MovesOnACone) {
  const double gravity = 9.81, theta = 0.7, duration = 3;
  const double rate = std::sqrt(gravity / std::cos(theta));
  const auto start = State<Spatial>::from_angles(Eigen::VectorXd::Constant(1, theta), Eigen::VectorXd::Zero(1),
                                                 Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, rate));
  for (Form form : {Form::momentum, Form::velocity}) {
    const State<Spatial> end = final_state(equal_chain<Spatial>(1, gravity), start, gauss(4, form), 0.01, duration);
    EXPECT_NEAR(end.q[0], theta, 1e-15);            // measured 0
    EXPECT_NEAR(end.q[1], rate * duration, 2e-14);  // measured 1.8e-15
    EXPECT_NEAR(end.v[0], 0, 1e-15);                // measured 9e-17
  }
}

/// Zeros of the Laguerre polynomial L_n, ascending: eigenvalues of its Jacobi matrix.
Eigen::VectorXd laguerre_zeros(int n) {
  Eigen::MatrixXd jacobi = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) jacobi(i, i) = 2 * i + 1;
  for (int i = 1; i < n; ++i) jacobi(i, i - 1) = jacobi(i - 1, i) = i;
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(jacobi).eigenvalues();
}

template <class Kernel>
class PlanarModes : public ::testing::Test {};
using PlanarKernels = ::testing::Types<kernels::Planar1, kernels::Planar2, kernels::Planar3, kernels::Planar4>;
TYPED_TEST_SUITE(PlanarModes, PlanarKernels, KernelName);

// A chain of equal links swings with ω² = (g/l) x_k, x_k the zeros of the Laguerre polynomial L_n.
TYPED_TEST(PlanarModes, AreLaguerreZeros) {
  using Kernel = TypeParam;
  using Vector = typename Kernel::template Vector<double>;
  const Chain<Planar> chain = equal_chain<Planar>(Kernel::links);
  const Vector hanging = Vector::Zero();
  const typename Kernel::template Torque<double> none = Kernel::template Torque<double>::Zero();
  typename Kernel::template Matrix<double> mass, stiffness;
  Kernel::residual_D_a(parameters_of<Kernel>(chain), hanging, hanging, hanging, none, mass);
  Kernel::residual_D_q(parameters_of<Kernel>(chain), hanging, hanging, hanging, none, stiffness);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> modes(stiffness, mass);
  const Eigen::VectorXd expected = chain.gravity() * laguerre_zeros(Kernel::links);
  EXPECT_LT(((modes.eigenvalues() - expected).array() / expected.array()).abs().maxCoeff(), 3e-14);  // measured 2.6e-15
}

// Started in a vertical plane, a spatial chain stays in it and moves as the planar one; away from the pole here,
// because (θ, φ) end there.
TEST(SpatialChain, InAPlaneMovesAsThePlanarChain) {
  const double azimuth = 0.8;
  const Eigen::Vector3d theta(1.2, 0.9, 1.4), theta_dot(0.5, -0.3, 0.2);
  const auto flat = State<Planar>::from_angles(theta, theta_dot);
  const auto tilted = State<Spatial>::from_angles(theta, Eigen::Vector3d::Constant(azimuth), theta_dot);
  const State<Planar> planar_end = final_state(equal_chain<Planar>(3), flat, gauss(4), 0.005, 0.2);
  const State<Spatial> spatial_end = final_state(equal_chain<Spatial>(3), tilted, gauss(4), 0.005, 0.2);
  EXPECT_LT((spatial_end.theta() - planar_end.q).cwiseAbs().maxCoeff(), 3e-15);      // measured 2e-16
  EXPECT_LT((spatial_end.theta_dot() - planar_end.v).cwiseAbs().maxCoeff(), 1e-14);  // measured 7e-16
  EXPECT_LT((spatial_end.phi().array() - azimuth).abs().maxCoeff(), 1e-15);          // measured 0
}

TEST(SpatialChain, KeepsVerticalAngularMomentumAndEnergy) {
  const Chain<Spatial> chain = equal_chain<Spatial>(3);
  const auto start = State<Spatial>::from_angles(Eigen::Vector3d(1.2, 1.0, 1.4), Eigen::Vector3d(0, 0.5, -0.4),
                                                 Eigen::Vector3d::Zero(), Eigen::Vector3d(2, 2.5, 1.5));
  const State<Spatial> end = final_state(chain, start, gauss(6), 0.01, 1);
  EXPECT_NEAR(vertical_angular_momentum(chain, end), vertical_angular_momentum(chain, start),
              1e-13);                                            // measured 1.1e-14
  EXPECT_NEAR(energy(chain, end), energy(chain, start), 1e-13);  // measured 1.2e-14
}

/// ∫ Σ λ_i |û̇_i|² dt along the rows of a fine run, by Simpson's rule.
template <class Space>
double dissipated(const Chain<Space>& chain, const State<Space>& start, double step, double duration) {
  std::vector<double> power;
  const auto integrator = make_integrator(chain, gauss(4));
  const RunResult result = simulate(*integrator, start, {step, duration, 1},
                                    [&](const auto& state) { power.push_back(dissipation(chain, state)); });
  EXPECT_TRUE(result.outcome);
  double integral = 0;
  for (std::size_t i = 0; i + 2 < power.size(); i += 2) integral += power[i] + 4 * power[i + 1] + power[i + 2];
  return integral * step / 3;
}

template <class Space>
Chain<Space> damped_chain(int links) {
  ChainParameters<Space> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(links);
  parameters.damping = Eigen::VectorXd::LinSpaced(links, 0.5, 1.5);
  return Chain<Space>(parameters);
}

TEST(Damping, TakesOutTheEnergyThatIsLost) {
  const Chain<Planar> flat = damped_chain<Planar>(3);
  const State<Planar> start = planar({1.5, 1.0, 2.0});
  const State<Planar> end = final_state(flat, start, gauss(4), 1e-3, 1);
  EXPECT_NEAR(energy(flat, start) - energy(flat, end), dissipated(flat, start, 1e-3, 1),
              5e-10);  // measured 9e-11, of Simpson's rule

  const Chain<Spatial> chain = damped_chain<Spatial>(2);
  const auto tilted = State<Spatial>::from_angles(Eigen::Vector2d(1.2, 1.0), Eigen::Vector2d(0, 0.5),
                                                  Eigen::Vector2d::Zero(), Eigen::Vector2d(2.5, 2.0));
  const State<Spatial> spatial_end = final_state(chain, tilted, gauss(4), 1e-3, 0.6);
  EXPECT_NEAR(energy(chain, tilted) - energy(chain, spatial_end), dissipated(chain, tilted, 1e-3, 0.6),
              5e-11);  // measured 5e-12
}

TEST(Load, AConstantTorqueShiftsTheEquilibrium) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
  parameters.torque = Eigen::MatrixXd::Constant(1, 1, 9.81 * std::sin(0.4));
  const State<Planar> start = planar({0.4});
  const State<Planar> end = final_state(Chain<Planar>(parameters), start, gauss(2), 0.01, 1);
  EXPECT_NEAR(end.q[0], 0.4, 1e-15);  // measured 0
}

// A planar torque +σ is the vector (0, −σ, 0) in the x–z plane.
TEST(Load, ASpatialTorqueVectorIsThePlanarTorqueInThePlane) {
  ChainParameters<Planar> flat;
  flat.masses = flat.lengths = Eigen::VectorXd::Ones(2);
  flat.torque = Eigen::RowVector2d(2.0, -1.0);
  flat.drives.push_back({1, Eigen::Matrix<double, 1, 1>(1.5), 3.0, 0.4});
  ChainParameters<Spatial> tilted;
  tilted.masses = tilted.lengths = Eigen::VectorXd::Ones(2);
  tilted.torque.setZero(3, 2);
  tilted.torque.row(1) = -flat.torque;
  tilted.drives.push_back({1, Eigen::Vector3d(0, -1.5, 0), 3.0, 0.4});
  const State<Planar> end = final_state(Chain<Planar>(flat), planar({1.2, 0.9}), gauss(4), 1e-3, 0.2);
  const auto start = State<Spatial>::from_angles(Eigen::Vector2d(1.2, 0.9), Eigen::Vector2d::Zero());
  const State<Spatial> spatial_end = final_state(Chain<Spatial>(tilted), start, gauss(4), 1e-3, 0.2);
  EXPECT_LT((spatial_end.theta() - end.q).cwiseAbs().maxCoeff(), 1e-15);  // measured 0
}

// The drive's order: a time-dependent torque must be taken at the stages' own times.
TEST(Load, ADrivenChainKeepsTheOrder) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(2);
  parameters.drives.push_back({0, Eigen::Matrix<double, 1, 1>(5.0), 4.0, 0.4});
  const Chain<Planar> chain(parameters);
  const State<Planar> start = planar({0.5, 0.2});
  for (Form form : {Form::momentum, Form::velocity}) {
    const State<Planar> reference = final_state(chain, start, gauss(8), 1.0 / 128, 1);
    ErrorLadder ladder;
    for (double step = 1.0 / 8; ladder.steps.size() < 4; step /= 2) {
      ladder.steps.push_back(step);
      ladder.errors.push_back(distance(final_state(chain, start, gauss(2, form), step, 1), reference));
    }
    EXPECT_NEAR(ladder.slope(1e-13), 4, 0.1);  // measured within 0.034
  }
}

// Time in √(l/g), masses and lengths in any unit: the motion is the same.
TEST(Scaling, LeavesTheMotionAlone) {
  const double mass = 3.7, length = 0.21;
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::Vector2d(1, 2) * mass;
  parameters.lengths = Eigen::Vector2d(1, 0.5) * length;
  const Chain<Planar> scaled(parameters);
  parameters.masses /= mass;
  parameters.lengths /= length;
  const Chain<Planar> unit(parameters);
  const State<Planar> start = planar({1.0, 0.3});
  const double slower = std::sqrt(length);
  const State<Planar> end = final_state(unit, start, gauss(4), 0.01, 1);
  const State<Planar> scaled_end = final_state(scaled, start, gauss(4), 0.01 * slower, slower);
  EXPECT_LT((scaled_end.q - end.q).cwiseAbs().maxCoeff(), 5e-15);           // measured 4e-16
  EXPECT_LT((scaled_end.v * slower - end.v).cwiseAbs().maxCoeff(), 3e-14);  // measured 3e-15
}

TEST(Symmetry, MirroredStartsMoveMirrored) {
  const State<Planar> end = final_state(equal_chain<Planar>(3), planar({1.0, 0.3, 2.0}), gauss(3), 0.01, 1);
  const State<Planar> mirrored = final_state(equal_chain<Planar>(3), planar({-1.0, -0.3, -2.0}), gauss(3), 0.01, 1);
  EXPECT_EQ((end.q + mirrored.q).cwiseAbs().maxCoeff(), 0);
}

// Without gravity a single pendulum turns uniformly.
TEST(FreeFall, OnePendulumTurnsUniformly) {
  const auto start = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, 0.3), Eigen::VectorXd::Constant(1, 2.0));
  for (Form form : {Form::momentum, Form::velocity}) {
    const State<Planar> end = final_state(equal_chain<Planar>(1, 0), start, gauss(2, form), 0.01, 1);
    EXPECT_NEAR(end.q[0], 2.3, 5e-15);  // measured 4e-16
    EXPECT_NEAR(end.v[0], 2.0, 1e-15);  // measured 0
  }
}

}  // namespace
}  // namespace pendula::test
