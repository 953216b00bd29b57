// Derivatives of motions by their start, parameters and inputs, and linear systems beside motions. What they are is
// compared with differences in python/tests/test_derivatives.py.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/derivatives.hpp>
#include <pendula/run/linearize.hpp>
#include <stdexcept>

#include "support/random_chain.hpp"

namespace pendula {
namespace {

using test::equal_chain;

const RunOptions in_steps{.stages = 3, .step = 0.01};

Motion let_go(int links) {
  return {0, Eigen::VectorXd::LinSpaced(links, 1.0, 0.4), Eigen::VectorXd::LinSpaced(links, 0.2, -0.1)};
}

TEST(Derivatives, BackwardIsTheTransposeOfForward) {
  for (const Solver solver : {Solver::chain, Solver::dense}) {
    const ChainSubject<Planar> chain(equal_chain<Planar>(3));
    RunOptions options = in_steps;
    options.solver = solver;
    const Motion start = let_go(3);
    const std::array<double, 2> times = {0.1, 0.305};
    const MotionTask task{.subject = chain, .options = options, .start = start, .times = times};
    const Eigen::Index state = 6, varied = 3 + 3 + 3 + 1 + 3, all = state + varied;
    const Directions<> seeds = Directions<>::Identity(all, all);
    const Forward forward = move_variations(task, seeds.topRows(state), seeds.bottomRows(varied));
    const Directions<> gradients = Directions<>::Random(state, 2);
    const Backward backward = move_gradients(task, gradients);
    ASSERT_TRUE(forward.outcome && backward.outcome);
    Eigen::VectorXd ahead = Eigen::VectorXd::Zero(all), back(all);
    for (std::size_t k = 0; k < 2; ++k) {
      ahead += forward.variations[k].transpose() * gradients.col(static_cast<Eigen::Index>(k));
      EXPECT_EQ(forward.motions[k].q, backward.motions[k].q);
    }
    back << backward.of_start, backward.of_parameters;
    EXPECT_LT((ahead - back).norm(), 1e-12 * ahead.norm());  // measured 1.3e-15
  }
}

TEST(Derivatives, OfAnEventNeedTheField) {
  const ChainSubject<Planar> chain(equal_chain<Planar>(1));
  const Eigen::VectorXd field =
      field_at(chain, {0, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Constant(1, 2.0)});
  EXPECT_EQ(field[0], 2.0);
  EXPECT_NEAR(field[1], -9.81 * std::sin(0.5), 1e-14);  // measured 0
}

TEST(Derivatives, RefuseWhatHasNone) {
  const ChainSubject<Planar> chain(equal_chain<Planar>(2));
  const Motion start = let_go(2);
  const std::array<double, 2> times = {0.2, 0.1}, later = {0.1, 0.2};
  const Directions<> seeds = Directions<>::Identity(4, 4), none = Directions<>::Zero(9, 4);
  RunOptions explicit_steps{.method = Method::rk4, .step = 0.01};
  EXPECT_THROW(move_variations({.subject = chain, .options = in_steps, .start = start, .times = times}, seeds, none),
               std::invalid_argument);
  EXPECT_THROW(
      move_variations({.subject = chain, .options = explicit_steps, .start = start, .times = later}, seeds, none),
      std::invalid_argument);
  EXPECT_THROW(move_variations({.subject = chain, .options = in_steps, .start = start, .times = later}, seeds, seeds),
               std::invalid_argument);
  EXPECT_THROW(move_gradients({.subject = chain, .options = in_steps, .start = start, .times = later}, seeds),
               std::invalid_argument);
}

TEST(Derivatives, StopWhereThatIsAsked) {
  const ChainSubject<Planar> chain(equal_chain<Planar>(2));
  const Motion start = let_go(2);
  const std::array<double, 1> times = {1.0};
  int asked = 0;
  const MotionTask task{
      .subject = chain, .options = in_steps, .start = start, .times = times, .stop = [&] { return ++asked > 3; }};
  const Forward moved = move_variations(task, Directions<>::Identity(4, 4), Directions<>::Zero(9, 4));
  EXPECT_EQ(moved.outcome.status, Status::interrupted);
  EXPECT_TRUE(moved.motions.empty());
}

TEST(Equilibrium, IsTheNearestOne) {
  const ChainSubject<Planar> chain(equal_chain<Planar>(2));
  const Motion near_top(0, Eigen::Vector2d(3.0, 3.3), Eigen::Vector2d(1, 1));
  const Motion top = equilibrium(chain, near_top);
  EXPECT_LT((top.q - Eigen::Vector2d::Constant(std::numbers::pi)).norm(), 1e-14);  // measured 0
  EXPECT_EQ(top.v.norm(), 0);
}

}  // namespace
}  // namespace pendula
