// Steps of chains whose last bob is held: what they keep exactly.

#include <algorithm>
#include <limits>
#include <pendula/chain/invariants.hpp>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

/// Held where its last bob is in a state.
template <class Space>
Chain<Space> held_there(const Chain<Space>& free, const State<Space>& state) {
  ChainParameters<Space> parameters{free.masses(), free.lengths()};
  parameters.end.emplace();
  const Points<Space, Eigen::Dynamic> bobs = bob_positions(free, state);
  std::copy_n(bobs.col(free.links() - 1).data(), Space::dimension, parameters.end->at.data());
  return Chain<Space>(parameters);
}

template <class Space>
class HeldChain : public ::testing::Test {};
using Spaces = ::testing::Types<Planar, Spatial>;
TYPED_TEST_SUITE(HeldChain, Spaces);

TYPED_TEST(HeldChain, StepsBackLeadToTheStart) {
  using Space = TypeParam;
  Random random(5);
  const Chain<Space> free = random_chain<Space>(random, 4, false);
  const State<Space> start = random_state<Space>(random, 4);
  const Chain<Space> chain = held_there(free, start);
  for (int stages = 1; stages <= 8; ++stages) {
    RunOptions options;
    options.stages = stages;
    const auto integrator = make_integrator(chain, options);
    ASSERT_TRUE(integrator->start(start));
    const Motion begin = integrator->state();
    for (int k = 0; k < 100; ++k) ASSERT_TRUE(integrator->step(2e-3));
    EXPECT_GT((integrator->state().q - begin.q).cwiseAbs().maxCoeff(), 1e-3);
    for (int k = 0; k < 100; ++k) ASSERT_TRUE(integrator->step(-2e-3));
    const Motion end = integrator->state();
    EXPECT_LT((end.q - begin.q).cwiseAbs().maxCoeff(), 1e-14) << stages;  // measured 0
    EXPECT_LT((end.v - begin.v).cwiseAbs().maxCoeff(), 1e-13) << stages;  // measured 5e-16
  }
}

/// The impulse that gives the end its rate takes nothing from the energy of a state that has it already.
TYPED_TEST(HeldChain, StartsLoseNoMoreEnergyThanTheEndTakes) {
  using Space = TypeParam;
  Random random(6);
  const Chain<Space> free = random_chain<Space>(random, 6, false);
  const State<Space> start = random_state<Space>(random, 6);
  const Chain<Space> chain = held_there(free, start);
  const auto integrator = make_integrator(chain, RunOptions{});
  ASSERT_TRUE(integrator->start(start));
  const State<Space> held = integrator->state();
  EXPECT_LT(bob_velocities(chain, held).col(5).norm(), 1e-14);  // measured 3.3e-16
  EXPECT_LT(energies(chain, held).kinetic, energies(chain, start).kinetic);
  ASSERT_TRUE(integrator->start(held));
  const State<Space> again = integrator->state();
  EXPECT_LT((again.v - held.v).cwiseAbs().maxCoeff(), 1e-13);  // measured 1.1e-15
}

TEST(HeldChainParameters, ANumberThatIsNotFiniteIsRefused) {
  ChainParameters<Planar> parameters{Eigen::VectorXd::Ones(3), Eigen::VectorXd::Ones(3)};
  parameters.end = ChainEnd{.at = {1.0, std::numeric_limits<double>::quiet_NaN()}};
  EXPECT_THROW(Chain<Planar>{parameters}, std::invalid_argument);
}

}  // namespace
}  // namespace pendula::test
