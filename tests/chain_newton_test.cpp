// The stage equations along a chain: Newton and the fixed point find one solution, Newton is exact, and chain and dense
// solver are two discretisations of one motion, equal to the order of the method; with all loads.

#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/run/integrator.hpp>

#include "support/kernels.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

template <class Kernel>
class ChainStageEquations : public ::testing::Test {
 protected:
  using Space = SpaceOf<Kernel>;
  static constexpr int links = Kernel::links;

  ChainStageEquations() : chain(driven_chain<Space>(random, links)), start(random_state<Space>(random, links)) {}

  Motion run(Solver solver, int stages, Iteration iteration, int steps, double h) {
    RunOptions options;
    options.stages = stages;
    options.solver = solver;
    options.iteration = iteration;
    const auto integrator = make_integrator(chain, options);
    EXPECT_TRUE(integrator->start(start));
    for (int i = 0; i < steps; ++i) {
      const Outcome outcome = integrator->step(h);
      EXPECT_TRUE(outcome) << outcome;
    }
    return integrator->state();
  }

  Motion along_chain(int stages, Iteration iteration, int steps, double h) {
    return run(Solver::chain, stages, iteration, steps, h);
  }
  Motion dense(int stages, int steps, double h) { return run(Solver::dense, stages, Iteration::automatic, steps, h); }

  Random random{7};
  Chain<Space> chain;
  State<Space> start;
};

TYPED_TEST_SUITE(ChainStageEquations, CommittedKernels, KernelName);

TYPED_TEST(ChainStageEquations, HaveOneSolution) {
  for (int stages = 1; stages <= 8; ++stages) {
    const auto expected = this->along_chain(stages, Iteration::fixed_point, 100, 0.005);
    for (Iteration iteration : {Iteration::newton, Iteration::automatic}) {
      const auto got = this->along_chain(stages, iteration, 100, 0.005);
      EXPECT_LT(distance(got, expected), 2e-14) << stages << " stages, " << iteration;  // measured 1.1e-15
    }
  }
}

// A term of Newton's matrix that were wrong or missing would make it converge linearly.
TYPED_TEST(ChainStageEquations, AreSolvedQuadratically) {
  using KernelSpace = SpaceOf<TypeParam>;
  constexpr int S = 3;
  ChainStages<KernelSpace, S> stages(this->chain);
  ChainNewton<KernelSpace, S> newton(TypeParam::links);
  stages.start(this->start);
  stages.prepare({0, 0.08});  // large, so that every term counts
  double before = newton.correct(stages).relative;
  for (int iteration = 2; iteration <= 5; ++iteration) {
    const double correction = newton.correct(stages).relative;
    EXPECT_LT(correction, 2 * before * before + 1e-15) << "iteration " << iteration;  // measured 0.018 from 0.2
    before = correction;
  }
  EXPECT_LT(before, 1e-15) << "it does not converge";
  EXPECT_TRUE(newton.positive());
}

TYPED_TEST(ChainStageEquations, AreThoseOfTheDenseSolverToTheOrderOfTheMethod) {
  for (int stages : {1, 2, 3}) {
    const auto difference = [&](int steps) {
      const double h = 0.1 / steps;
      return distance(this->along_chain(stages, Iteration::automatic, steps, h), this->dense(stages, steps, h));
    };
    const int steps = stages == 1 ? 40 : stages == 2 ? 20 : 8;
    EXPECT_NEAR(std::log2(difference(steps) / difference(2 * steps)), 2 * stages, 0.2)
        << stages;  // measured within 0.097
  }
}

TYPED_TEST(ChainStageEquations, OfManyStagesEndWhereTheDenseSolverDoes) {
  EXPECT_LT(distance(this->along_chain(8, Iteration::automatic, 50, 0.01), this->dense(8, 50, 0.01)),
            2e-14);  // measured 4.0e-15
}

// The first step of a run may be of no length: coefficients of the step are all zero then, but not what depends on
// none.
TYPED_TEST(ChainStageEquations, OfAStepOfNoLengthGoNowhere) {
  EXPECT_LT(distance(this->dense(3, 1, 0), this->start), 1e-14);  // measured 2e-15
  for (Iteration iteration : {Iteration::newton, Iteration::fixed_point, Iteration::automatic}) {
    EXPECT_LT(distance(this->along_chain(3, iteration, 1, 0), this->start), 1e-14) << iteration;  // measured 1e-15
  }
}

// Where weight acts as a force, too (ChainStages::hanging): Newton is exact, and what it finds is a fixed point.
template <class Space>
void expect_exact_newton_in_a_long_step(double gravity) {
  constexpr int S = 3, n = 20;
  ChainParameters<Space> parameters;
  parameters.masses = Eigen::VectorXd::LinSpaced(n, 1, 2);
  parameters.lengths = Eigen::VectorXd::LinSpaced(n, 0.05, 0.08);
  parameters.gravity = gravity;
  parameters.damping = Eigen::VectorXd::Constant(n, 1e-3);
  parameters.torque = Torque<Space, Eigen::Dynamic>::Constant(Space::torque_components, n, 0.02);
  const double down = gravity > 0 ? 0 : M_PI;
  Eigen::VectorXd q = Eigen::VectorXd::Zero(Space::dof * n);
  q.head(n).setLinSpaced(down + 0.1, down + 0.4);
  ChainStages<Space, S> stages{Chain<Space>(parameters)};
  ChainNewton<Space, S> newton(n);
  stages.start(State<Space>{0, q, Eigen::VectorXd::Zero(Space::dof * n)});
  stages.prepare({0, 0.08});
  ASSERT_GT(stages.hanging(0), 0);
  double before = newton.correct(stages).relative;
  for (int iteration = 2; iteration <= 7; ++iteration) {
    const double correction = newton.correct(stages).relative;
    EXPECT_LT(correction, 2 * before * before + 1e-13) << "iteration " << iteration;  // measured 3.6e-4 from 0.03
    before = correction;
  }
  EXPECT_LT(before, 1e-13) << "it does not converge";  // measured 1.2e-14
  newton.find_multipliers(stages);
  EXPECT_LT(stages.turn(), 3);         // and the size of the step is known
  EXPECT_LT(stages.iterate(), 1e-12);  // measured 3.3e-14
}

TEST(ChainNewtonInALongStep, IsExact) {
  for (double gravity : {9.81, -9.81}) {
    expect_exact_newton_in_a_long_step<Planar>(gravity);
    expect_exact_newton_in_a_long_step<Spatial>(gravity);
  }
}

// Of long chains what is found inward is kept for some links at a time.
template <class Space>
void expect_newton_in_blocks_to_be_the_same() {
  constexpr int S = 3, n = 23;
  Random random(5);
  const Chain<Space> chain = driven_chain<Space>(random, n);
  const State<Space> start = random_state<Space>(random, n);
  ChainStages<Space, S> whole(chain), in_blocks(chain);
  ChainNewton<Space, S> newton(n), newton_in_blocks(n, 5);
  for (ChainStages<Space, S>* stages : {&whole, &in_blocks}) {
    stages->start(start);
    stages->prepare({0, 0.02});
  }
  for (int iteration = 1; iteration <= 3; ++iteration) {
    EXPECT_EQ(newton.correct(whole).relative, newton_in_blocks.correct(in_blocks).relative) << iteration;
    EXPECT_EQ(newton.positive(), newton_in_blocks.positive());
  }
  EXPECT_EQ(newton.worst_link(whole), newton_in_blocks.worst_link(in_blocks));
  whole.accept();
  in_blocks.accept();
  EXPECT_EQ(distance(whole.state(0.02), in_blocks.state(0.02)), 0);
}

TEST(ChainNewtonInBlocks, IsTheSameToTheLastBit) {
  expect_newton_in_blocks_to_be_the_same<Planar>();
  expect_newton_in_blocks_to_be_the_same<Spatial>();
}

}  // namespace
}  // namespace pendula::test
