// Radau IIA: order 2s − 1 along the chain and dense, and damping far faster than a step.

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

RunOptions radau(int stages, Solver solver) {
  RunOptions options;
  options.method = Method::radau;
  options.stages = stages;
  options.solver = solver;
  return options;
}

class Radau : public ::testing::TestWithParam<std::tuple<int, Solver>> {};
INSTANTIATE_TEST_SUITE_P(Stages, Radau,
                         ::testing::Combine(::testing::Values(2, 3), ::testing::Values(Solver::chain, Solver::dense)));

template <class Space>
double order(int stages, Solver solver) {
  Random random(5);
  const Chain<Space> chain = random_chain<Space>(random, 2, true);
  const State<Space> start = random_state<Space>(random, 2);
  RunOptions exact;
  exact.stages = 8;
  const State<Space> reference = final_state(chain, start, exact, 1.0 / 64, 0.5);
  ErrorLadder ladder;
  for (double count : {24, 32, 48, 64}) {
    ladder.steps.push_back(0.5 / count);
    const State<Space> end = final_state(chain, start, radau(stages, solver), 0.5 / count, 0.5);
    ladder.errors.push_back(distance(end, reference));
  }
  return ladder.slope(1e-13);
}

TEST_P(Radau, HasItsOrder) {
  const auto [stages, solver] = GetParam();
  EXPECT_NEAR(order<Planar>(stages, solver), 2 * stages - 1, 0.1);   // measured within 0.022
  EXPECT_NEAR(order<Spatial>(stages, solver), 2 * stages - 1, 0.1);  // measured within 0.013
}

// m l²/λ = 2.5 ns: it stops at once, and then creeps at M g l sin θ/λ.
TEST_P(Radau, FollowsDampingFarFasterThanAStep) {
  const auto [stages, solver] = GetParam();
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::VectorXd::Constant(1, 0.001);
  parameters.lengths = Eigen::VectorXd::Constant(1, 0.05);
  parameters.damping = Eigen::VectorXd::Constant(1, 1000.0);
  const Chain<Planar> chain(parameters);
  const auto start = State<Planar>::from_angles(Eigen::VectorXd::Ones(1), Eigen::VectorXd::Constant(1, 20));
  const State<Planar> end = final_state(chain, start, radau(stages, solver), 1e-3, 1);
  const double creeping = -0.001 * 9.81 * 0.05 * std::sin(end.q[0]) / 1000;
  EXPECT_NEAR(end.v[0], creeping, 1e-5 * std::abs(creeping));  // measured 3.5e-13 of 4e-7
  EXPECT_NEAR(end.q[0], 1 + 20 * 2.5e-9 + creeping, 1e-12);    // measured 5.4e-14
}

TEST(Radau, HasTwoOrThreeStages) {
  for (const Solver solver : {Solver::chain, Solver::dense}) {
    for (const int stages : {1, 4, 8}) {
      EXPECT_THROW(make_integrator(equal_chain<Planar>(2), radau(stages, solver)), std::invalid_argument) << stages;
    }
  }
}

}  // namespace
}  // namespace pendula::test
