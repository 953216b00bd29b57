// Derivatives of runs of chains: through poles, of steps that were taken in parts, by any iteration, of a cost by all
// that it depends on, and behind the run-time interface.

#include <stdexcept>
#include <vector>

#include <pendula/run/integrator.hpp>

#include "support/tangents.hpp"

namespace pendula::test {
namespace {

// A spherical pendulum that swings through the vertical, and what hangs on it.
TEST(ChainTangentsAlongARun, GoThroughThePole) {
  Random random(3);
  const Chain<Spatial> chain = random_chain<Spatial>(random, 2);
  State<Spatial> start = random_state<Spatial>(random, 2);
  start.q << -0.35, 1.1, 0.3, 1.2;
  start.v << 2, 1, 0, 0.3;
  const ChainRun<Spatial, 2, long double> run(chain, start.cast<long double>(), 0.05, 6);
  const auto end = run.end(chain, run.start());
  EXPECT_LT(std::sin(end[0]) * std::cos(end[2] - 0.3L) * std::sin(-0.35L), -0.01L) << "it does not come by the pole";
  EXPECT_LT(distance(run.tangents().of_start, run.differences()), 1e-10);  // measured 1.5e-12
}

// Also of steps that were taken in parts, whose derivative is that of all parts.
TEST(ChainTangentsAlongARun, HoldStepsThatAreTakenInParts) {
  Random random(3);
  const Chain<Planar> chain = driven_chain<Planar>(random, 3);
  State<Planar> start = random_state<Planar>(random, 3);
  start.v << 5, -12, 9;
  const ChainRun<Planar, 3, long double> run(chain, start.cast<long double>(), 0.5);
  const auto found = run.tangents();
  EXPECT_GT(found.rejected, 0);
  EXPECT_LT(distance(found.of_start, run.differences()), 1e-9);  // measured 4.5e-11, of the differences
}

// Newton and the fixed point leave the same stages.
TEST(ChainTangentsAlongARun, AreThoseOfAnyIteration) {
  Random random(3);
  const Chain<Spatial> chain = driven_chain<Spatial>(random, 3);
  const auto start = random_state<Spatial>(random, 3).cast<long double>();
  const auto expected = ChainRun<Spatial, 2, long double>(chain, start, 0.02, 10, Iteration::newton).tangents();
  const auto got = ChainRun<Spatial, 2, long double>(chain, start, 0.02, 10, Iteration::fixed_point).tangents();
  EXPECT_LT(distance(got.of_start, expected.of_start), 1e-16);            // measured 1.2e-18
  EXPECT_LT(distance(got.of_parameters, expected.of_parameters), 1e-16);  // measured 1.1e-18
}

TEST(ChainTangentsAlongARun, LeaveTheRunAsItIs) {
  Random random(3);
  const Chain<Spatial> chain = driven_chain<Spatial>(random, 4);
  const State<Spatial> start = random_state<Spatial>(random, 4);
  GaussStepper<ChainSolver<Spatial, 4>> with(chain, 4), without(chain, 4);
  with.linearize();
  ASSERT_TRUE(with.start(start));
  ASSERT_TRUE(without.start(start));
  for (int k = 0; k < 200; ++k) {
    ASSERT_TRUE(with.step(0.02));
    ASSERT_TRUE(without.step(0.02));
  }
  EXPECT_EQ(with.state().q, without.state().q);
  EXPECT_EQ(with.state().v, without.state().v);
}

// The height of the last bob at the end, by all that it depends on: one pull through the steps, last to first.
TEST(ChainTangentsAlongARun, GiveTheGradientOfACost) {
  Random random(3);
  const Chain<Planar> chain = driven_chain<Planar>(random, 3);
  using Solver = ChainSolver<Planar, 3>;
  GaussStepper<Solver> stepper(chain, 3);
  stepper.linearize();
  ASSERT_TRUE(stepper.start(random_state<Planar>(random, 3)));
  std::vector<Linearization<Solver::Tangent>> steps;
  for (int k = 0; k < 20; ++k) {
    ASSERT_TRUE(stepper.step(0.02));
    steps.push_back(stepper.linearization());
  }
  Directions<> cost = Directions<>::Zero(6, 1);
  const Eigen::VectorXd theta = stepper.state().q;
  cost.topRows(3) = chain.lengths().array() * theta.array().sin();  // δy of −Σ l cos θ: here δû is δθ
  Directions<> gradient = cost, of_parameters = Directions<>::Zero(steps[0].parameters(), 1);
  for (std::size_t k = steps.size(); k-- > 0;) steps[k].pull(gradient, of_parameters);
  Directions<> tangents = identity(6), sensitivities = Directions<>::Zero(6, of_parameters.rows());
  for (auto& step : steps) {
    step.push(tangents);
    step.push(sensitivities, identity(of_parameters.rows()));
  }
  EXPECT_LT(distance(gradient, tangents.transpose() * cost), 1e-13);            // measured 6.7e-16
  EXPECT_LT(distance(of_parameters, sensitivities.transpose() * cost), 1e-13);  // measured 4.2e-16
}

TEST(ChainTangentsAlongARun, RefuseOtherNumbersOfRows) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  GaussStepper<ChainSolver<Planar, 2>> stepper(chain, 2);
  stepper.linearize();
  Directions<> tangents = identity(5), parameters = identity(4);
  EXPECT_THROW(stepper.linearization().push(tangents), std::invalid_argument);
  tangents = identity(4);
  EXPECT_THROW(stepper.linearization().push(tangents, parameters), std::invalid_argument);
}

// --- Behind the run-time interface ---

TEST(IntegratorTangents, AreThoseOfTheStepper) {
  Random random(5);
  const Chain<Planar> chain = driven_chain<Planar>(random, 4);
  const State<Planar> start = random_state<Planar>(random, 4);
  RunOptions options;
  options.stages = 3;
  options.solver = Solver::chain;
  const auto integrator = make_integrator(chain, options);
  GaussStepper<ChainSolver<Planar, 3>> stepper(chain, 3);
  stepper.linearize();
  ASSERT_EQ(integrator->linearize(), stepper.linearization().size());
  ASSERT_TRUE(integrator->start(start));
  ASSERT_TRUE(stepper.start(start));
  Directions<> got = identity(8), expected = got;
  for (int k = 0; k < 10; ++k) {
    ASSERT_TRUE(integrator->step(0.02));
    ASSERT_TRUE(stepper.step(0.02));
    integrator->push(got);
    stepper.linearization().push(expected);
  }
  EXPECT_LT(distance(got, expected), 1e-12);  // measured 2.5e-16; two compilations
}

TEST(IntegratorTangents, AreRefusedWhereThereAreNone) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  RunOptions options;
  options.method = Method::rk4;
  EXPECT_THROW(make_integrator(chain, options)->linearize(), std::invalid_argument);
  options = {};
  options.form = Form::velocity;
  EXPECT_THROW(make_integrator(chain, options)->linearize(), std::invalid_argument);
}

}  // namespace
}  // namespace pendula::test
