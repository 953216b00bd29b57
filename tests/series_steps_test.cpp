// Steps by the Taylor series of a kernel: where they end, what one sees within them, and steps that are cut short.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <pendula/kernels/swinging_atwood.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/kernel_table.hpp>

namespace pendula {
namespace {

RunOptions by(Method method, double tolerance) {
  return {.method = method, .stages = 8, .step = 0, .tolerance = tolerance};
}

/// A bob of 1 kg, and a counterweight of 2.5 kg: without an integral, so that its motion is chaotic.
SystemSubject atwood(double gravity = 9.81) {
  const std::shared_ptr<const SystemTable> table(&system_table<kernels::SwingingAtwood>, [](const SystemTable*) {});
  SystemNumbers numbers;
  for (const std::string_view name : table->info.parameters) {
    numbers.parameters.push_back(name == "gravity" ? gravity : name == "mu" ? 2.5 : 1.0);
  }
  return {table, numbers};
}

Motion start() {
  return {0, Eigen::Vector2d(1.0, 1.2), Eigen::Vector2d(0.1, 0.0)};
}

Motion moved(const SystemSubject& system, const RunOptions& options, double duration) {
  const auto integrator = system.make_integrator(options);
  EXPECT_TRUE(integrator->start(start()));
  while (integrator->time() < duration) EXPECT_TRUE(integrator->step(duration - integrator->time()));
  return integrator->state();
}

double apart(const Motion& a, const Motion& b) {
  return std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff());
}

TEST(SeriesSteps, GoWhereGaussStepsGo) {
  const SystemSubject system = atwood();
  const Motion exact = moved(system, by(Method::gauss, 1e-15), 5);
  EXPECT_LT(apart(moved(system, by(Method::taylor, 1e-4), 5), exact), 2e-3);    // measured 2.2e-4
  EXPECT_LT(apart(moved(system, by(Method::taylor, 1e-8), 5), exact), 7e-8);    // measured 6.7e-9
  EXPECT_LT(apart(moved(system, by(Method::taylor, 1e-13), 5), exact), 1e-12);  // measured 9e-14
}

TEST(SeriesSteps, LooksIntoStepsAreStepsThatEndThere) {
  const SystemSubject system = atwood();
  const auto whole = system.make_integrator(by(Method::taylor, 1e-10));
  ASSERT_TRUE(whole->start(start()));
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(whole->step(1));
  const auto cut = system.make_integrator(by(Method::taylor, 1e-10));
  cut->resume(whole->member());
  const double begin = whole->time();
  ASSERT_TRUE(whole->step(1));
  const double middle = begin + 0.6 * (whole->time() - begin);
  ASSERT_TRUE(cut->step(middle - begin));
  Motion found;
  ASSERT_TRUE(whole->at_full_order(middle, found));
  EXPECT_LT(apart(found, cut->state()), 4e-14);       // measured 4e-15
  EXPECT_LT(apart(whole->at(middle), found), 3e-13);  // measured 3e-14
}

TEST(SeriesSteps, GoOnFromACopyToTheBit) {
  const SystemSubject system = atwood();
  const auto first = system.make_integrator(by(Method::taylor, 1e-9)),
             second = system.make_integrator(by(Method::taylor, 1e-9));
  ASSERT_TRUE(first->start(start()));
  for (int k = 0; k < 7; ++k) ASSERT_TRUE(first->step(1));
  second->resume(first->member());
  for (int k = 0; k < 7; ++k) ASSERT_TRUE(first->step(1) && second->step(1));
  EXPECT_EQ(first->member(), second->member());
}

/// What cuts a step short, as the end of a run or a sample, says nothing of how long steps may be.
TEST(SeriesSteps, AreLongAgainAfterAShortOne) {
  const SystemSubject system = atwood();
  const auto integrator = system.make_integrator(by(Method::taylor, 1e-12));
  ASSERT_TRUE(integrator->start(start()));
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(integrator->step(1));
  const double before = integrator->statistics().largest_step;
  ASSERT_TRUE(integrator->step(1e-12));
  const double at = integrator->time();
  ASSERT_TRUE(integrator->step(1));
  EXPECT_GT(integrator->time() - at, 0.1 * before);
  EXPECT_EQ(integrator->statistics().rejected_steps, 0);
}

/// Gravity in other units: the same motion, slower or faster.
TEST(SeriesSteps, KnowNoUnitOfTime) {
  for (const double pace : {1e-8, 1e8}) {
    const SystemSubject system = atwood(9.81 * pace * pace);
    const auto integrator = system.make_integrator(by(Method::taylor, 1e-12));
    Motion from = start();
    from.v *= pace;
    ASSERT_TRUE(integrator->start(from));
    const double duration = 2 / pace;
    while (integrator->time() < duration) ASSERT_TRUE(integrator->step(duration - integrator->time()));
    Motion end = integrator->state();
    end.v /= pace;
    EXPECT_LT(apart(end, moved(atwood(), by(Method::taylor, 1e-12), 2)), 5e-14) << pace;  // measured 6e-15
    EXPECT_LT(integrator->statistics().steps, 60) << pace;                                // measured 31
  }
}

}  // namespace
}  // namespace pendula
