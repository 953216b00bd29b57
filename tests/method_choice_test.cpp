// Which runs Taylor series take over from Gauss steps, and what becomes of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <pendula/kernels/swinging_atwood.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/method_choice.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/kernel_table.hpp>
#include <utility>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

RunSetup run_of_chain(int links, double tolerance = 1e-9, double duration = 10, double damping = 0) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(links);
  parameters.damping = Eigen::VectorXd::Constant(links, damping);
  RunSetup setup;
  setup.subject = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  setup.start = {0, Eigen::VectorXd::LinSpaced(links, 0.5, 1), Eigen::VectorXd::Zero(links)};
  setup.options = {.stages = 8, .step = 0, .tolerance = tolerance};
  setup.duration = duration;
  setup.chooses_method = true;
  return setup;
}

RunSetup run_of_machine() {
  const std::shared_ptr<const SystemTable> table(&system_table<kernels::SwingingAtwood>, [](const SystemTable*) {});
  RunSetup setup = run_of_chain(2);
  setup.subject = std::make_shared<SystemSubject>(table, SystemNumbers{{2.5, 1, 9.81}, {}, {}});
  setup.start = {0, Eigen::Vector2d(1, 1.2), Eigen::Vector2d::Zero()};
  return setup;
}

TEST(MethodChoice, TakesSeriesOfFewCoordinates) {
  for (const RunSetup& setup : {run_of_chain(1), run_of_chain(2), run_of_chain(3), run_of_machine()}) {
    EXPECT_GT(choose_method(setup).series_tolerance, 0);
    RunSetup gauss = setup;
    gauss.chooses_method = false;
    gauss.options.tolerance = 1e-14;
    const RunReport report = pendula::Run(setup).go(), exact = pendula::Run(gauss).go();
    EXPECT_EQ(report.options.method, Method::taylor);
    EXPECT_EQ(report.motion_tolerance, 1e-9);
    EXPECT_EQ(report.method_reason, "few coordinates, and series take less time");
    EXPECT_LT(setup.subject->distance(report.last, exact.last), 1e-9);  // measured 7e-11
    EXPECT_LT(report.energy_error.largest, 1e-10);                      // measured 8e-12
    EXPECT_TRUE(report.warnings.empty());
  }
}

TEST(MethodChoice, LeavesTheOthersToGaussSteps) {
  EXPECT_EQ(choose_method(run_of_chain(4)).reason, "many links");
  EXPECT_EQ(choose_method(run_of_chain(3, 1e-12)).reason, "many links");
  EXPECT_EQ(choose_method(run_of_chain(2, 1e-9, 10, 500)).reason, "strong damping");
  EXPECT_EQ(choose_method(run_of_chain(2, 1e-12, 1e5)).reason, "a long run, in which series lose energy");
  EXPECT_EQ(choose_method(run_of_chain(2, 1e-9, 0)).reason, "no motion");
  RunSetup space = run_of_chain(2);
  space.subject = std::make_shared<ChainSubject<Spatial>>(equal_chain<Spatial>(2));
  EXPECT_EQ(choose_method(space).reason, "a chain in space");
  EXPECT_EQ(pendula::Run(run_of_chain(4)).go().options.method, Method::gauss);
}

/// A rod that is let go level does not swing yet: damping that is weak was "strong" there.
TEST(MethodChoice, JudgesDampingWhereTheMotionIs) {
  RunSetup level = run_of_chain(1, 1e-9, 10, 0.01);
  level.start.q[0] = std::numbers::pi / 2;
  EXPECT_GT(choose_method(level).series_tolerance, 0);
  RunSetup strong = run_of_chain(1, 1e-9, 10, 500);
  strong.start.q[0] = std::numbers::pi / 2;
  EXPECT_EQ(choose_method(strong).reason, "strong damping");
}

/// The energy does not drift beyond the tolerance.
TEST(MethodChoice, MovesLongerRunsByASmallerTolerance) {
  RunSetup setup = run_of_chain(2, 1e-6, 2000);
  setup.judged = false;
  const double tolerance = choose_method(run_of_chain(2, 1e-6)).series_tolerance;
  EXPECT_LT(choose_method(setup).series_tolerance, 0.2 * tolerance);
  EXPECT_LT(pendula::Run(setup).go().energy_error.largest, 3e-10);  // measured 2.1e-11
}

/// Keeps every checkpoint that it is given.
class Keeper : public Observer {
 public:
  void take(const Row& /*row*/) override {}
  bool wants_checkpoint() const override { return true; }
  void keep(const Checkpoint& checkpoint) override { kept.push_back(checkpoint); }

  std::vector<Checkpoint> kept;
};

TEST(MethodChoice, IsKeptByRunsThatGoOn) {
  RunSetup setup = run_of_chain(2, 1e-9, 4);
  setup.estimate = false;
  Keeper keeper;
  pendula::Run whole(setup);
  whole.add(keeper);
  const Motion end = whole.go().last;
  const Checkpoint& on_the_way = keeper.kept[keeper.kept.size() / 2];
  const Motion continued = pendula::Run(setup).go_on(on_the_way).last;
  EXPECT_EQ(continued.q, end.q);
  EXPECT_EQ(continued.v, end.v);
  // With another end: by the same steps, where one that begins anew has others, or none.
  setup.duration = 1e7;
  EXPECT_EQ(choose_method(setup).series_tolerance, 0);
  RunSetup longer = setup;
  longer.duration = 8;
  longer.options.tolerance = 1e-9;
  const RunReport report = pendula::Run(longer).go_on(on_the_way);
  EXPECT_EQ(report.options.method, Method::taylor);
  EXPECT_EQ(report.end, RunEnd::complete);
  RunSetup asked = setup;
  asked.chooses_method = false;
  EXPECT_THROW(pendula::Run(asked).go_on(on_the_way), std::invalid_argument);
}

}  // namespace
}  // namespace pendula::test
