// The O(n) chain solver is the dense solver, to round-off: the same Newton direction, the same steps, with all loads.

#include <pendula/gauss/chain_solver.hpp>
#include <pendula/gauss/dense_newton.hpp>

#include "support/kernels.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

template <class Kernel>
class ChainIsDense : public ::testing::Test {
 protected:
  using Space = SpaceOf<Kernel>;
  static constexpr int links = Kernel::links;

  ChainIsDense() : chain(driven_chain()), start(random_state<Space>(random, links)) {}

  Chain<Space> driven_chain() {
    const Chain<Space> loaded = random_chain<Space>(random, links, true);
    ChainParameters<Space> parameters{loaded.masses(),  loaded.lengths(),         9.81,
                                      loaded.damping(), loaded.constant_torque(), {}};
    Drive<Space> drive;
    drive.link = links - 1;
    drive.amplitude.setConstant(0.7);
    drive.frequency = 5;
    drive.phase = 0.3;
    parameters.drives = {drive};
    return Chain<Space>(parameters);
  }

  template <class Stepper>
  State<Space> run(Stepper&& stepper, int steps, double h) {
    EXPECT_TRUE(stepper.start(start));
    for (int i = 0; i < steps; ++i) {
      const Outcome outcome = stepper.step(h);
      EXPECT_TRUE(outcome) << outcome;
    }
    return stepper.state();
  }

  State<Space> dense(int stages, int steps, double h) {
    return run(GaussStepper<DenseMomentumNewton<Kernel>>(chain, stages), steps, h);
  }

  State<Space> along_chain(int stages, Iteration iteration, int steps, double h) {
    RunOptions options;
    options.stages = stages;
    options.solver = Solver::chain;
    options.iteration = iteration;
    return run(*make_integrator(chain, options), steps, h);
  }

  Random random{7};
  Chain<Space> chain;
  State<Space> start;
};

TYPED_TEST_SUITE(ChainIsDense, KernelsToFour, KernelName);

TYPED_TEST(ChainIsDense, InOneStep) {
  for (int stages = 1; stages <= 8; ++stages) {
    const auto expected = this->dense(stages, 1, 0.02);
    for (Iteration iteration : {Iteration::newton, Iteration::fixed_point, Iteration::automatic}) {
      const auto got = this->along_chain(stages, iteration, 1, 0.02);
      EXPECT_LT(distance(got, expected), 2e-14) << stages << " stages, " << iteration;  // measured 4e-15
    }
  }
}

TYPED_TEST(ChainIsDense, InARun) {
  for (int stages = 1; stages <= 8; ++stages) {
    const auto expected = this->dense(stages, 100, 0.005);
    for (Iteration iteration : {Iteration::newton, Iteration::fixed_point, Iteration::automatic}) {
      const auto got = this->along_chain(stages, iteration, 100, 0.005);
      EXPECT_LT(distance(got, expected), 7e-14) << stages << " stages, " << iteration;  // measured 1.1e-14
    }
  }
}

/// Stage velocities of the chain solver in the order of the dense one: θ_1..θ_n, φ_1..φ_n.
template <class Space, int S>
Eigen::VectorXd stage(const ChainStages<Space, S>& stages, std::size_t i) {
  Eigen::VectorXd V(Space::dof * stages.links());
  for (int link = 0; link < stages.links(); ++link) {
    const auto rates = stages.rates(link);
    for (std::size_t a = 0; a < rates.size(); ++a) {
      alignas(pack_alignment) double lanes[Lanes<S>::size];
      rates[a].store(lanes);
      V[static_cast<Eigen::Index>(a) * stages.links() + link] = lanes[i];
    }
  }
  return V;
}

TYPED_TEST(ChainIsDense, InTheNewtonDirection) {
  using Kernel = TypeParam;
  using KernelSpace = SpaceOf<Kernel>;
  constexpr int S = 3;
  constexpr double h = 0.2;  // large, so that every term of Newton's matrix counts
  DenseMomentumNewton<Kernel> dense(this->chain, S);
  ChainStages<KernelSpace, S> chain_stages(this->chain);
  ChainNewton<KernelSpace, S> newton(Kernel::links);
  ASSERT_EQ(dense.start(this->start), Status::ok);
  chain_stages.start(this->start);
  dense.prepare(0, h);
  chain_stages.prepare(0, h);
  for (int iteration = 1; iteration <= 2; ++iteration) {
    const double size = dense.correct().relative;
    EXPECT_GT(size, 1e-7) << "a correction that is only rounding compares nothing";
    newton.correct(chain_stages);
    for (int i = 0; i < S; ++i) {
      const Eigen::VectorXd expected = dense.stage(i), got = stage(chain_stages, static_cast<std::size_t>(i));
      EXPECT_LT((got - expected).norm(), 1e-13 * expected.norm()) << "iteration " << iteration;  // measured 8e-15
    }
  }
}

// The first step of a run may be of no length: coefficients of the step are all zero then, but not what depends on
// none.
TYPED_TEST(ChainIsDense, InAStepOfNoLength) {
  EXPECT_LT(distance(this->dense(3, 1, 0), this->start), 1e-14);  // measured 2e-15
  for (Iteration iteration : {Iteration::newton, Iteration::fixed_point, Iteration::automatic}) {
    EXPECT_LT(distance(this->along_chain(3, iteration, 1, 0), this->start), 1e-14) << iteration;  // measured 1e-15
  }
}

}  // namespace
}  // namespace pendula::test
