// Sampled feedback: what is held between samples, and what looks into steps, copies and failures see of it.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/feedback.hpp>
#include <pendula/run/inputs.hpp>
#include <stdexcept>
#include <vector>

#include "support/random_chain.hpp"

namespace pendula {
namespace {

using test::equal_chain;

const RunOptions in_steps{.stages = 4, .step = 0.01};
constexpr double sample = 0.05;

std::shared_ptr<const Subject> chain() {
  return std::make_shared<ChainSubject<Planar>>(equal_chain<Planar>(2));
}

double brake(const Motion& motion) {
  return -2 * motion.v[0];
}

Motion let_go() {
  return {0, Eigen::Vector2d(1.0, 0.4), Eigen::Vector2d(0.2, -0.1)};
}

double apart(const Motion& a, const Motion& b) {
  return std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff());
}

TEST(Feedback, IsHeldFromSampleToSample) {
  const auto fed = with_feedback(chain(), {{.input = 0, .value = brake, .sample = sample}});
  const auto found = fed->make_integrator(in_steps);
  ASSERT_TRUE(found->start(let_go()));
  Motion true_motion = let_go();
  for (int k = 0; k < 20; ++k) {
    const std::vector<double> held{brake(true_motion), 0};
    const auto piece = with_inputs(chain(), held)->make_integrator(in_steps);
    ASSERT_TRUE(piece->start(true_motion));
    for (int step = 0; step < 5; ++step) {
      EXPECT_NEAR(found->state().held[0], held[0], 3e-14);  // measured 3e-15
      ASSERT_TRUE(found->step(0.01));
      ASSERT_TRUE(piece->step(0.01));
    }
    true_motion = piece->state();
    EXPECT_LT(apart(found->state(), true_motion), 4e-14);  // measured 4e-15
  }
  EXPECT_EQ(found->statistics().steps, 100);
}

TEST(Feedback, IsThatOfTheLastStepWhereOneLooksBack) {
  const auto fed = with_feedback(chain(), {{.input = 0, .value = brake, .sample = sample}});
  const auto found = fed->make_integrator(in_steps);
  found->remember_steps(true);
  ASSERT_TRUE(found->start(let_go()));
  for (int k = 0; k < 4; ++k) ASSERT_TRUE(found->step(0.01));
  const double before = found->state().held[0];
  ASSERT_TRUE(found->step(0.01));  // where the next sample is
  const double after = found->state().held[0];
  EXPECT_NE(before, after);
  Motion within;
  double work = 0;
  ASSERT_TRUE(found->at_full_order(0.045, within, work));
  EXPECT_EQ(within.held[0], before);
  EXPECT_EQ(found->at(0.045).held[0], before);
  EXPECT_LT(apart(found->at(0.045), within), 1e-8);  // measured 1.2e-9
  EXPECT_GT(work, 0);
  EXPECT_LT(work, found->statistics().load_work);
}

TEST(Feedback, GoesOnFromACopyToTheBit) {
  const auto fed = with_feedback(chain(), {{.input = 0, .value = brake, .sample = 0.07, .limit = 0.5},
                                           {.input = 1, .value = brake, .sample = 0.03}});
  const auto first = fed->make_integrator(in_steps), second = fed->make_integrator(in_steps);
  ASSERT_TRUE(first->start(let_go()));
  for (int k = 0; k < 9; ++k) ASSERT_TRUE(first->step(0.01));
  second->resume(first->member());
  for (int k = 0; k < 40; ++k) {
    ASSERT_TRUE(first->step(0.01));
    ASSERT_TRUE(second->step(0.01));
  }
  EXPECT_EQ(first->member(), second->member());
  EXPECT_EQ(first->state().held, second->state().held);
  EXPECT_LE(std::abs(first->state().held[0]), 0.5);
}

TEST(Feedback, WithoutAValueEndsTheMotion) {
  const auto nothing = [](const Motion& motion) {
    return motion.time < 0.1 ? 0.0 : std::numeric_limits<double>::quiet_NaN();
  };
  const auto integrator =
      with_feedback(chain(), {{.input = 1, .value = nothing, .sample = sample}})->make_integrator(in_steps);
  ASSERT_TRUE(integrator->start(let_go()));
  Outcome outcome;
  for (int k = 0; k < 20 && outcome; ++k) outcome = integrator->step(0.01);
  EXPECT_EQ(outcome.status, Status::not_finite);
  EXPECT_NEAR(integrator->time(), 0.1, 1e-12);
}

TEST(Feedback, RefusesWhatIsNoInput) {
  EXPECT_THROW(with_feedback(chain(), {{.input = 2, .value = brake, .sample = sample}}), std::invalid_argument);
  EXPECT_THROW(with_feedback(chain(), {{.input = 0, .value = brake}}), std::invalid_argument);
  const auto fed = with_feedback(chain(), {{.input = 0, .value = brake, .sample = sample}});
  EXPECT_THROW(fed->make_integrator(in_steps)->linearize(), std::invalid_argument);
  EXPECT_THROW(input_names(*fed), std::invalid_argument);
}

}  // namespace
}  // namespace pendula
