// Angles of many turns: taken out and put back, and a link that goes round for hours over its generated kernel.

#include <gtest/gtest.h>

#include <cmath>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/numeric/full_turns.hpp>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

TEST(FullTurns, AreTakenOutAndPutBack) {
  Random random(10);
  for (int k = 0; k < 10000; ++k) {
    const double size = std::pow(10, random.uniform(-3, 14));
    const double angle = random.uniform(-size, size);
    Compensated<double> within{angle, 0};
    double turns = 0;
    detail::take_out_turns(within, turns, true);
    EXPECT_LE(std::abs(within.value), 8);
    EXPECT_EQ(detail::with_turns(within, turns), angle);
    EXPECT_NEAR(std::sin(within.value), std::sin(angle), 5e-16) << angle;  // measured 2.3e-16
  }
}

// With the turns left in, every force is taken where a rounded angle points: 3.6e-11.
TEST(FullTurns, OfALinkThatGoesRoundKeepItsEnergy) {
  const Chain<Planar> chain = equal_chain<Planar>(1);
  State<Planar> start = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, 1e6 + 0.3));
  start.v[0] = 50;
  const auto integrator = make_integrator(chain, gauss(8));
  ASSERT_TRUE(integrator->start(start));
  EXPECT_EQ(integrator->state().q, start.q);
  for (int i = 0; i < 200'000; ++i) ASSERT_TRUE(integrator->step(0.01));
  const State<Planar> end = integrator->state();
  EXPECT_GT(end.q[0], 1e6 + 9.9e4);
  const double whole = energy(chain, start);
  EXPECT_LT(std::abs(energy(chain, end) - whole) / whole,
            2e-12);  // measured 6e-13, of which a last bit of the angle is 1e-12
}

}  // namespace
}  // namespace pendula::test
