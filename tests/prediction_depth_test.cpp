// What stages are predicted from: of one motion, by which of two ways the first correction is smaller.

#include <gtest/gtest.h>

#include <cstdint>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/gauss/step_prediction.hpp>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

/// Steps of 1000 that are predicted from many, where such first corrections are as large as told.
int predicted_by_many(double by_many, double by_last) {
  PredictionDepth depth;
  int count = 0;
  for (int step = 0; step < 1000; ++step) {
    if (depth.next(step > 0, 2, 8) > 0) ++count;
    depth.saw(depth.is_by_many() ? by_many : by_last);
  }
  return count;
}

TEST(PredictionDepth, IsWhatNeedsLess) {
  EXPECT_EQ(predicted_by_many(1e-6, 1e-3), 1000 - 3 - 31);  // but for those that know too few, and trials
  EXPECT_EQ(predicted_by_many(1e-2, 1e-3), 5 + 31);         // until that is known, and trials
}

TEST(PredictionDepth, FollowsStepsOfOneSizeAlone) {
  PredictionDepth depth;
  for (int step = 0; step < 20; ++step) EXPECT_EQ(depth.next(step % 3 != 0, 2, 8), 0) << step;
  for (int step = 0; step < 20; ++step) EXPECT_EQ(depth.next(true, 8, 1), 0) << step;  // methods of many stages
  for (int step = 0; step < 20; ++step) depth.next(true, 2, 8);
  EXPECT_EQ(depth.next(true, 2, 8), 8);
  depth.forget();
  EXPECT_EQ(depth.next(true, 2, 8), 0);
}

/// Fixed-point iterations a step, of a double pendulum.
double iterations(Solver solver, int stages, double h) {
  RunOptions options;
  options.solver = solver;
  options.stages = stages;
  options.step = h;
  options.iteration = Iteration::fixed_point;
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const auto integrator = make_integrator(chain, options);
  EXPECT_TRUE(integrator->start(State<Planar>::from_angles(Eigen::Vector2d(1.5, 1.2))));
  constexpr int steps = 1000;
  for (int step = 0; step < steps; ++step) EXPECT_TRUE(integrator->step(h));
  return static_cast<double>(integrator->statistics().newton_iterations) / steps;
}

// From the last step alone it takes a chain 5.1 and 4.2 iterations.
TEST(PredictionDepth, HalvesTheIterationsOfShortSteps) {
  for (const Solver solver : {Solver::dense, Solver::chain}) {
    EXPECT_LT(iterations(solver, 2, 1e-3), 3.2) << name_of(solver);  // measured 2.78 and 2.32
    EXPECT_LT(iterations(solver, 3, 1e-3), 3.2) << name_of(solver);  // measured 2.83 and 2.29
  }
}

// From eight steps it takes 13.58, from the last step alone 12.73.
TEST(PredictionDepth, DoesNotAddToThoseOfLongSteps) {
  EXPECT_LT(iterations(Solver::chain, 3, 0.06), 13);  // measured 12.76
}

}  // namespace
}  // namespace pendula::test
