// The chain solver in other number types than double: as right as their last bit allows.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/gauss/stepper.hpp>

#include "support/random_chain.hpp"

namespace pendula::test {
namespace {

// Sanitizers take minutes to compile eight stages.
constexpr int many_stages = 8;

template <class Space, int S, class Real>
State<Space, Eigen::Dynamic, Real> end_state(const Chain<Space>& chain, const State<Space>& start, Iteration iteration,
                                             double step, int steps) {
  GaussStepper<ChainSolver<Space, S, Eigen::Dynamic, Real>> stepper(chain, S, {}, iteration);
  EXPECT_TRUE(stepper.start(start.template cast<Real>()));
  for (int k = 0; k < steps; ++k) {
    const Outcome outcome = stepper.step(step);
    if (!outcome) ADD_FAILURE() << outcome;
    if (!outcome) break;
  }
  return stepper.state();
}

/// Largest difference of any angle or rate, in the last places of a `Real` near 1.
template <class Real, class Space>
double distance_in_ulp(const State<Space, Eigen::Dynamic, Real>& a,
                       const State<Space, Eigen::Dynamic, long double>& b) {
  const auto wide = a.template cast<long double>();
  const long double distance = std::max((wide.q - b.q).cwiseAbs().maxCoeff(), (wide.v - b.v).cwiseAbs().maxCoeff());
  return static_cast<double>(distance / std::numeric_limits<Real>::epsilon());
}

template <class Real>
class NumberType : public ::testing::Test {};
using Narrow = ::testing::Types<float, double>;
TYPED_TEST_SUITE(NumberType, Narrow, );

// With damping, torque and a drive; the first link starts at the pole.
TYPED_TEST(NumberType, EndsWhereAWiderOneDoesInSpace) {
  Random random(7);
  ChainParameters<Spatial> parameters;
  parameters.masses = random.matrix<Eigen::VectorXd>(5, 1, 0.5, 2);
  parameters.lengths = random.matrix<Eigen::VectorXd>(5, 1, 0.5, 2);
  parameters.damping = random.matrix<Eigen::VectorXd>(5, 1, 0.1, 1);
  parameters.torque = random.matrix<Torque<Spatial, Eigen::Dynamic>>(3, 5, -2, 2);
  parameters.drives = {{2, Eigen::Vector3d(1, 2, 3), 5, 0.5}};
  const Chain<Spatial> chain(parameters);
  State<Spatial> start = random_state<Spatial>(random, 5);
  start.q[0] = 0;
  const auto expected = end_state<Spatial, 2, long double>(chain, start, Iteration::newton, 1.0 / 128, 64);
  for (Iteration iteration : {Iteration::newton, Iteration::fixed_point, Iteration::automatic}) {
    const auto got = end_state<Spatial, 2, TypeParam>(chain, start, iteration, 1.0 / 128, 64);
    EXPECT_LT(distance_in_ulp(got, expected), 100) << iteration;  // measured 56
  }
}

TYPED_TEST(NumberType, EndsWhereAWiderOneDoesInThePlane) {
  Random random(8);
  const Chain<Planar> chain = random_chain<Planar>(random, 5);
  const auto start = random_state<Planar>(random, 5);
  const auto expected = end_state<Planar, many_stages, long double>(chain, start, Iteration::newton, 1.0 / 128, 64);
  for (Iteration iteration : {Iteration::newton, Iteration::fixed_point, Iteration::automatic}) {
    const auto got = end_state<Planar, many_stages, TypeParam>(chain, start, iteration, 1.0 / 128, 64);
    EXPECT_LT(distance_in_ulp(got, expected), 30) << iteration;  // measured 10, with three stages 13
  }
}

// An order that double is too short to show. The coefficients must have all the bits of a long double, too.
TEST(LongDouble, ShowsTheOrderOfEightStages) {
  if (std::numeric_limits<long double>::digits < 64) GTEST_SKIP() << "long double is double here";
  const Chain<Planar> chain = equal_chain<Planar>(1);
  const auto start = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, 0.3), Eigen::VectorXd::Constant(1, 0.2));
  const auto end = [&](int steps) {
    return end_state<Planar, 8, long double>(chain, start, Iteration::newton, 2.25 / steps, steps);
  };
  const auto reference = end(36);
  const double order = std::log2(distance_in_ulp(end(4), reference) / distance_in_ulp(end(8), reference));
  EXPECT_NEAR(order, 16, 0.5);  // measured 15.9
}

TEST(LongDouble, KeepsEnergyToItsOwnLastBits) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const auto start = State<Planar>::from_angles(Eigen::Vector2d(1.2, 0.7));
  const auto end = end_state<Planar, 8, long double>(chain, start, Iteration::fixed_point, 1.0 / 256, 2560);
  const long double change = energy(chain, end) - energy(chain, start.cast<long double>());
  const auto ulps = static_cast<double>(change / energy_scale(chain) / std::numeric_limits<long double>::epsilon());
  EXPECT_LT(std::abs(ulps), 2);  // measured 0.27
}

}  // namespace
}  // namespace pendula::test
