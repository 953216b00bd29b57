// A run as a program of one's own makes it: who is told its rows, how it ends, what is left of it then.

#include <cmath>
#include <cstdint>
#include <optional>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/run.hpp>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

RunSetup double_pendulum(double duration) {
  RunSetup setup{{.duration = duration},
                 std::make_shared<ChainSubject<Planar>>(equal_chain<Planar>(2)),
                 State<Planar>::from_angles(Eigen::Vector2d(1, 2))};
  setup.options.stages = 8;
  setup.options.step = 0.01;
  return setup;
}

class Listener : public Observer {
 public:
  explicit Listener(double until = 1e300) : until_(until) {}

  void take(const Row& row) override {
    if (row.motion.time > until_) throw std::runtime_error("no more");
    EXPECT_EQ(row.numbers[0], row.motion.time);
    EXPECT_EQ(row.numbers.back(), row.seen.energy);
    ++rows;
  }
  void finish() override { ++finished; }

  int rows = 0, finished = 0;

 private:
  double until_;
};

TEST(Run, HandsEveryRowToEveryObserver) {
  Listener one, two;
  pendula::Run run(double_pendulum(1));
  run.add(one);
  run.add(two);
  const RunReport report = run.go();
  EXPECT_EQ(report.end, RunEnd::complete);
  EXPECT_EQ(report.rows, 11);
  EXPECT_EQ(one.rows, 11);
  EXPECT_EQ(two.rows, 11);
  EXPECT_EQ(one.finished, 1);
  EXPECT_EQ(report.last.time, 1);
  EXPECT_EQ(report.table.size(), 11U);
  EXPECT_EQ(report.statistics.steps, 100);
  EXPECT_LT(report.energy_error.largest, 1e-14);  // measured 1.3e-15
  EXPECT_GT(report.stepping_seconds, 0);
  EXPECT_TRUE(report.warnings.empty());
}

TEST(Run, KeepsWhatItHasWhereAnObserverFails) {
  Listener failing(0.55), other;
  pendula::Run run(double_pendulum(1));
  run.add(other);
  run.add(failing);
  const RunReport report = run.go();
  EXPECT_EQ(report.end, RunEnd::observer_failed);
  EXPECT_THROW(std::rethrow_exception(report.failure), std::runtime_error);
  EXPECT_EQ(other.finished, 1);
  EXPECT_NEAR(report.last.time, 0.6, 1e-15);  // the row was taken by all before
}

TEST(Run, EndsAtAStateThatIsNoRow) {
  RunSetup setup = double_pendulum(1);
  setup.start.v[0] = 1e200;  // finite, but its energy is not
  Listener listener;
  pendula::Run run(setup);
  run.add(listener);
  const RunReport report = run.go();
  EXPECT_EQ(report.end, RunEnd::not_finite);
  EXPECT_EQ(listener.rows, 0);
  EXPECT_EQ(report.last.q, setup.start.q);
}

TEST(Run, StopsWhereItIsTold) {
  int asked = 0;
  const RunReport report = pendula::Run(double_pendulum(1)).go([&] { return ++asked == 25; });
  EXPECT_EQ(report.end, RunEnd::stopped);
  EXPECT_NEAR(report.last.time, 0.25, 1e-15);
  EXPECT_EQ(report.rows, 4);
}

/// The rows of a run, and where it could go on.
class Keeper : public Observer {
 public:
  void take(const Row& row) override {
    rows.emplace_back(row.numbers.begin(), row.numbers.end());
    motions.push_back(row.motion);
  }
  void keep(const Checkpoint& checkpoint) override { kept = checkpoint; }

  std::vector<std::vector<double>> rows;
  std::vector<Motion> motions;
  std::optional<Checkpoint> kept;
};

/// Runs on from what `keeper` has, or from the start, to `duration` or to the step of that number.
RunReport run_on(RunSetup setup, double duration, int steps, Keeper& keeper) {
  setup.duration = duration;
  pendula::Run run(setup);
  run.add(keeper);
  const auto stop = [&] { return --steps == 0; };
  if (!keeper.kept) return run.go(stop);
  const Checkpoint from = *keeper.kept;
  keeper.rows.resize(static_cast<std::size_t>(from.rows));
  return run.go_on(from, stop);
}

// Of a chain of a million links every trial takes seconds to begin.
TEST(Run, BeginsNoOtherTrialWhereItIsTold) {
  struct Counted : ChainSubject<Planar> {
    using ChainSubject::ChainSubject;
    std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const override {
      ++made;
      return ChainSubject::make_integrator(options);
    }
    mutable int made = 0;
  };
  const auto counted = std::make_shared<Counted>(equal_chain<Planar>(2));
  RunSetup setup = double_pendulum(10);
  setup.subject = counted;
  setup.options.step = 0;
  setup.accuracy.error = 1e-9;
  EXPECT_EQ(pendula::Run(setup).go([] { return true; }).end, RunEnd::stopped);
  EXPECT_EQ(counted->made, 2);  // by the run and its first trial
}

// To ends that are no multiple of the step, by signals between rows and at rows: what ends a run leaves no trace.
TEST(Run, GoesOnAsIfItHadNeverStopped) {
  Random random(11);
  for (const Method method :
       {Method::gauss, Method::radau, Method::rk4, Method::dopri5, Method::fehlberg78, Method::taylor}) {
    for (int trial = 0; trial < 10; ++trial) {
      RunSetup setup = double_pendulum(5);
      setup.options.method = method;
      setup.options.stages = 3;
      setup.options.step = random.uniform(0.004, 0.02);
      if (!is_explicit(method) && trial % 3 == 2) setup.options.step = 0;  // of its own choice
      setup.every = static_cast<std::int64_t>(random.uniform(1, 13));
      if (trial % 2 == 1) setup.rows.interval = random.uniform(0.002, 0.1);
      setup.judged = false;
      Keeper whole, parts;
      const RunReport expected = run_on(setup, 5.0, 0, whole);
      for (const double duration : {0.0, 0.7, 0.7, random.uniform(0.7, 3), 4.0}) {
        run_on(setup, duration, 0, parts);
        run_on(setup, 5.0, static_cast<int>(random.uniform(1, 31)), parts);
      }
      const RunReport report = run_on(setup, 5.0, 0, parts);
      EXPECT_EQ(report.rows, expected.rows) << method;
      EXPECT_TRUE(parts.rows == whole.rows) << method;
      // An adaptive run that goes on may see the end from farther away.
      EXPECT_TRUE(is_adaptive(setup.options) || parts.kept->integrator == whole.kept->integrator) << method;
      EXPECT_EQ(report.energy_error.largest, expected.energy_error.largest);
      EXPECT_EQ(report.statistics.steps, expected.statistics.steps);
      EXPECT_EQ(report.last.q, expected.last.q);
      EXPECT_EQ(report.table.back().time, 5);
    }
  }
}

// The steps are what they are without rows, and rows are as right as steps to their times are.
TEST(Run, HasRowsAtTimesThatItsStepsDoNotDependOn) {
  for (const Method method :
       {Method::gauss, Method::radau, Method::rk4, Method::dopri5, Method::fehlberg78, Method::taylor}) {
    RunSetup setup = double_pendulum(2);
    setup.options.method = method;
    setup.options.stages = method == Method::radau ? 3 : 8;
    setup.options.step = method == Method::gauss ? 0.05 : 0.002;
    setup.options.tolerance = 1e-12;
    Keeper without, fine, rows;
    const RunReport plain = run_on(setup, 2.0, 0, without);
    setup.rows.interval = 0.0137;
    const RunReport report = run_on(setup, 2.0, 0, rows);
    EXPECT_EQ(report.last.q, plain.last.q) << method;
    EXPECT_EQ(report.statistics.steps, plain.statistics.steps) << method;
    ASSERT_EQ(rows.rows.size(), 146U) << method;
    setup.options.step = setup.rows.interval / 4;
    setup.options.method = Method::gauss;
    setup.options.stages = 8;
    run_on(setup, 2.0, 0, fine);
    double furthest = 0;
    for (std::size_t k = 0; k < rows.rows.size(); ++k) {
      EXPECT_EQ(rows.rows[k][0], static_cast<double>(k) * 0.0137);
      for (std::size_t column = 1; column < 5; ++column) {
        furthest = std::max(furthest, std::abs(rows.rows[k][column] - fine.rows[k][column]));
      }
    }
    EXPECT_LT(furthest, method == Method::gauss ? 1e-13 : 2e-8) << method;  // measured 9.3e-15, 4.5e-9 (rk4)
  }
}

TEST(Run, HasRowsAtTimesThatAreListed) {
  RunSetup setup = double_pendulum(1);
  setup.rows.times = {0.1, 0.123, 0.124, 0.126, 1 / 3.0, 0.99};
  Keeper keeper;
  const RunReport report = run_on(setup, 1.0, 0, keeper);
  ASSERT_EQ(keeper.rows.size(), 6U);
  for (std::size_t k = 0; k < 6; ++k) EXPECT_EQ(keeper.rows[k][0], setup.rows.times[k]);
  EXPECT_EQ(report.rows, 6);
  EXPECT_EQ(report.last.time, 1);                 // of the motion, not of the rows
  EXPECT_LT(report.energy_error.largest, 1e-14);  // of the start, too
}

// A row at the end of a step is the state there.
TEST(Run, HasRowsAtTimesWhereStepsEnd) {
  RunSetup setup = double_pendulum(1);
  Keeper by_steps, by_times;
  run_on(setup, 1.0, 0, by_steps);
  setup.rows.interval = 0.1;
  run_on(setup, 1.0, 0, by_times);
  ASSERT_EQ(by_steps.rows.size(), by_times.rows.size());
  for (std::size_t k = 0; k < by_steps.rows.size(); ++k) {
    for (std::size_t column = 1; column < 5; ++column) EXPECT_EQ(by_steps.rows[k][column], by_times.rows[k][column]);
  }
}

// What a picture takes: rows as right as any at times, and nothing else is another one for them.
TEST(Run, HandsRowsAtTimesOfItsOwnToAnObserver) {
  for (const Method method : {Method::gauss, Method::radau, Method::rk4, Method::dopri5, Method::taylor}) {
    for (const bool adaptive : {false, true}) {
      if (is_explicit(method) && is_adaptive(method) != adaptive) continue;
      RunSetup setup = double_pendulum(2);
      setup.options.method = method;
      setup.options.stages = method == Method::radau ? 3 : 8;
      setup.options.step = adaptive ? 0 : 0.013;
      setup.options.tolerance = adaptive ? 1e-9 : 0;
      setup.every = 7;
      Keeper alone, beside, own, at_times;
      const RunReport plain = run_on(setup, 2.0, 0, alone);
      pendula::Run run(setup);
      run.add(beside);
      run.add(own, {0.0137, {}});
      const RunReport report = run.go();
      EXPECT_TRUE(beside.rows == alone.rows) << method;
      EXPECT_TRUE(beside.kept->integrator == alone.kept->integrator) << method;
      EXPECT_EQ(report.rows, plain.rows) << method;
      EXPECT_EQ(report.statistics.newton_iterations, plain.statistics.newton_iterations) << method;
      EXPECT_EQ(report.energy_error.largest, plain.energy_error.largest) << method;
      setup.rows.interval = 0.0137;
      run_on(setup, 2.0, 0, at_times);
      at_times.rows.push_back(alone.rows.back());  // the last state
      EXPECT_TRUE(own.rows == at_times.rows) << method;
    }
  }
}

// Wherever a run ends, that is the last row; one that goes on has those that are new.
TEST(Run, HandsTheLastStateToAnObserverWithTimesOfItsOwn) {
  RunSetup setup = double_pendulum(1);
  const RowTimes times{0.07, {}};
  const auto go = [&](Keeper& own, int steps = 0) {
    pendula::Run run(setup);
    run.add(own, times);
    return own.kept ? run.go_on(*own.kept) : run.go([&] { return --steps == 0; });
  };
  Keeper whole, stopped, ended;
  go(whole);
  ASSERT_EQ(whole.rows.size(), 16U);  // 0, 0.07, …, 0.98, and 1
  EXPECT_EQ(whole.rows.back()[0], 1);
  const RunReport report = go(stopped, 25);
  ASSERT_EQ(stopped.rows.size(), 5U);
  EXPECT_EQ(stopped.motions.back().q, report.last.q);
  stopped.rows.pop_back();
  go(stopped);
  EXPECT_TRUE(stopped.rows == whole.rows);
  setup.events = {{"early", [](const Motion& motion) { return motion.time - 0.123; }, Direction::both, true}};
  go(ended);
  ASSERT_EQ(ended.rows.size(), 3U);
  EXPECT_NEAR(ended.rows.back()[0], 0.123, 1e-15);
}

TEST(Run, KeepsCheckpointsNowAndThen) {
  RunSetup setup = double_pendulum(1);
  setup.checkpoint = 0;
  class Counter : public Observer {
   public:
    void take(const Row&) override { ++rows; }
    void keep(const Checkpoint& checkpoint) override {
      EXPECT_EQ(checkpoint.rows, rows);
      ++kept;
    }
    int rows = 0, kept = 0;
  } counter;
  pendula::Run run(setup);
  run.add(counter);
  run.go();
  EXPECT_EQ(counter.kept, 11);  // where it begins, at rows, and before the last step
}

TEST(Run, RefusesACheckpointOfAnotherMotion) {
  Keeper keeper;
  run_on(double_pendulum(1), 1.0, 0, keeper);
  RunSetup other = double_pendulum(1);
  other.options.stages = 3;
  EXPECT_THROW(pendula::Run(other).go_on(*keeper.kept), std::invalid_argument);
}

TEST(Run, SaysHowAStepFailed) {
  RunSetup setup = double_pendulum(2e4);
  setup.options.step = 1e4;
  const RunReport report = pendula::Run(setup).go();
  EXPECT_EQ(report.end, RunEnd::step_failed);
  EXPECT_FALSE(report.step);
  EXPECT_EQ(report.last.time, 0);
}

/// Where rows of a run are, and where they should be: by Gauss steps of a tolerance of 1e-16.
struct Compared {
  RunReport report;
  double largest = 0;  // distance of rows up to where they are said to be right, of so many of them
  std::size_t rows = 0, all = 0;
};
Compared compared(RunSetup setup, double interval) {
  setup.rows.interval = interval;
  Keeper keeper, exact;
  Compared found;
  pendula::Run run(setup);
  run.add(keeper);
  found.report = run.go();
  setup.options = {.stages = 8, .step = 0, .tolerance = 1e-16};
  setup.accuracy.error = 0;
  setup.judged = false;
  pendula::Run exactly(setup);
  exactly.add(exact);
  exactly.go();
  found.all = keeper.motions.size();
  EXPECT_EQ(found.all, exact.motions.size());
  for (std::size_t k = 0; k < found.all && keeper.motions[k].time <= found.report.trust.until; ++k) {
    found.largest = std::max(found.largest, setup.subject->distance(keeper.motions[k], exact.motions[k]));
    ++found.rows;
  }
  return found;
}

// Chaos decides where this goes: up to a time rows are right by whatever steps, and that is told.
TEST(Run, TellsUpToWhenRowsByConstantStepsAreRight) {
  for (const auto& [method, stages, step] :
       {std::tuple(Method::gauss, 2, 0.002), std::tuple(Method::gauss, 4, 0.01), std::tuple(Method::gauss, 8, 0.05),
        std::tuple(Method::radau, 3, 0.004), std::tuple(Method::rk4, 1, 0.002)}) {
    RunSetup setup = double_pendulum(60);
    setup.options = {.method = method, .stages = stages, .step = step};
    setup.start.q = Eigen::Vector2d(3, 3);
    const Compared found = compared(setup, 0.1);
    EXPECT_EQ(found.report.end, RunEnd::complete);
    ASSERT_EQ(found.report.warnings.size(), 1U) << method << stages;
    EXPECT_NE(found.report.warnings[0].find(" the motion goes elsewhere: rows after t = "), std::string::npos)
        << found.report.warnings[0];
    EXPECT_GT(found.rows, 30U) << method << stages;  // measured 57 to 207 of 601
    EXPECT_LT(found.largest, 1e-3) << method << stages;
    setup.estimate = false;
    const RunReport unknown = pendula::Run(setup).go();
    EXPECT_TRUE(unknown.warnings.empty());
    EXPECT_TRUE(std::isnan(unknown.trust.expected_error));
    setup.estimate = true;
    setup.duration = 2;
    const Compared right = compared(setup, 0.1);
    EXPECT_TRUE(right.report.warnings.empty()) << method << stages << right.report.warnings[0];
    EXPECT_LT(right.largest, right.report.trust.expected_error) << method << stages;
  }
}

// Nothing is longer: it is compared with shorter steps.
TEST(Run, TellsHowWellOneStepMovesAWholeRun) {
  for (const double step : {0.1, 0.2, 7.0}) {
    RunSetup setup = double_pendulum(0.1);
    setup.options = {.stages = 2, .step = step};
    const Compared found = compared(setup, 0.1);
    EXPECT_EQ(found.report.statistics.steps, 1);
    const double told = found.report.trust.expected_error;
    EXPECT_GT(found.largest, 1e-6) << step;      // measured 4.5e-6
    EXPECT_LT(found.largest, 2 * told) << step;  // measured 0.81
    EXPECT_GT(found.largest, 0.2 * told) << step;
  }
}

// Damping takes a chain to rest, which says nothing of how it came there.
TEST(Run, TellsUpToWhenRowsAreRightOfAMotionThatComesToRest) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector2d::Ones();
  parameters.damping = Eigen::Vector2d::Constant(0.05);
  RunSetup setup = double_pendulum(1500);
  setup.subject = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  setup.start.q = Eigen::Vector2d(2.5, 2.5);
  setup.options.step = 0;
  setup.options.tolerance = 1e-9;
  const Compared by_tolerance = compared(setup, 0.1);
  EXPECT_EQ(by_tolerance.report.warnings.size(), 1U);
  EXPECT_LT(by_tolerance.largest, 3e-6);  // measured 1.6e-6; a thousand tolerances are not told
  EXPECT_GT(by_tolerance.rows, 50U);
  setup.accuracy.error = 1e-9;
  const Compared by_accuracy = compared(setup, 0.1);
  EXPECT_EQ(by_accuracy.report.warnings.size(), 1U);
  EXPECT_LE(by_accuracy.report.options.tolerance, 1e-9);
  EXPECT_LT(by_accuracy.largest, 1e-9);
  EXPECT_GT(by_accuracy.rows, 50U);
  setup.duration = 5;
  const Compared before = compared(setup, 0.1);
  EXPECT_TRUE(before.report.warnings.empty());
  EXPECT_EQ(before.rows, before.all);
  EXPECT_LT(before.largest, 1e-9);
}

// Errors of rows of random chains over what was asked for: of how many the largest is from 0.003 to 3 (of single links,
// whose steps are as long as the method allows, it may be less), of how many it is more, and how many are warned of;
// and how many would be below 3 by a tolerance of that size.
struct Reached {
  int within = 0, above = 0, warned = 0, plain = 0;
};
template <class Space>
Reached reached(double accuracy, double duration, int count) {
  Random random(1);
  Reached reached;
  for (int k = 0; k < count; ++k) {
    const int links = 1 + static_cast<int>(random.uniform(0, 6.999));
    RunSetup setup;
    setup.subject = std::make_shared<ChainSubject<Space>>(random_chain<Space>(random, links));
    setup.start = Motion(0, random.matrix<Eigen::VectorXd>(Space::dof * links, 1, -3, 3),
                         random.matrix<Eigen::VectorXd>(Space::dof * links, 1, -2, 2));
    setup.options = {.stages = stages_for(Method::gauss, accuracy), .step = 0, .tolerance = accuracy};
    setup.duration = duration;
    setup.judged = false;
    reached.plain += compared(setup, duration / 20).largest < 3 * accuracy ? 1 : 0;
    setup.judged = true;
    setup.accuracy.error = accuracy;
    const Compared found = compared(setup, duration / 40);
    reached.warned += found.report.warnings.empty() ? 0 : 1;
    const bool is_above = found.largest >= 3 * accuracy;
    const bool is_coarsest = found.report.aimed->tolerance > 0.1;
    reached.above += is_above ? 1 : 0;
    if (found.report.warnings.empty()) reached.within += !is_above && (found.largest > 0.003 * accuracy || is_coarsest);
  }
  return reached;
}

template <class Space>
void expect_reached(double accuracy, int warned, int plain) {
  const Reached of = reached<Space>(accuracy, 5, 50);
  EXPECT_LE(of.warned, warned) << accuracy;
  EXPECT_LE(of.above, 1) << accuracy;
  EXPECT_GE(of.within, 0.9 * (50 - of.warned)) << accuracy;
  EXPECT_LT(of.plain, plain) << accuracy;
}

TEST(Run, ReachesTheAccuracyThatItIsAskedForWhereChaosAllows) {
  expect_reached<Planar>(1e-4, 3, 20);   // measured 48 of 48, 9
  expect_reached<Planar>(1e-7, 8, 25);   // measured 42 of 44, 15
  expect_reached<Planar>(1e-9, 12, 25);  // measured 38 of 41, 12
  expect_reached<Spatial>(1e-4, 1, 30);  // measured 50 of 50, 21
  expect_reached<Spatial>(1e-7, 1, 30);  // measured 49 of 50, 16
  expect_reached<Spatial>(1e-9, 1, 30);  // measured 50 of 50, 15
}

// Two trials were off by as much to the same side. So they parted by little, and the finer one was thought to be good.
TEST(Run, IsNotTakenInByATrialThatIsRightByChance) {
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::VectorXd::Constant(1, 0.9630623825974343);
  parameters.lengths = Eigen::VectorXd::Constant(1, 0.44634166986989315);
  RunSetup setup;
  setup.subject = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  setup.start = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, -3.113262913011959));
  setup.duration = 10.18928927017285;
  setup.options.step = 0;
  setup.accuracy.error = 1e-9;
  const Compared found = compared(setup, setup.duration / 100);
  EXPECT_TRUE(found.report.warnings.empty());
  EXPECT_LT(found.largest, 1e-9);  // measured 2.1e-10, before 1.4e-7
}

// Series keep more digits than a double: trials may use smaller tolerances than those of other explicit methods. The
// angle at the end: Taylor series of order 20 with 40 digits.
TEST(Run, ReachesATrillionthByTaylorSeriesWhereALinkWhirls) {
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::VectorXd::Constant(1, 2.267);
  parameters.lengths = Eigen::VectorXd::Constant(1, 1.153);
  RunSetup setup;
  setup.subject = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  setup.start = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, 2.158425829151964));
  setup.start.v[0] = -33.14;
  setup.duration = 6.584;
  setup.options.method = Method::taylor;
  setup.options.step = 0;
  setup.accuracy.error = 1e-12;
  const RunReport report = pendula::Run(setup).go();
  EXPECT_TRUE(report.warnings.empty());
  EXPECT_LT(std::abs(report.last.q[0] - -216.96565762449137), 1e-12);  // measured 1.4e-13, before 4.6e-11
}

// What chaos makes of rounding is told beforehand, and nobody runs again to know.
TEST(Run, SaysWhichAccuracyCannotBeReached) {
  RunSetup setup = double_pendulum(20);
  setup.options.step = 0;
  setup.start.q = Eigen::Vector2d(3, 3);
  setup.accuracy.error = 1e-12;
  const RunReport rounded = pendula::Run(setup).go();
  ASSERT_TRUE(rounded.aimed);
  EXPECT_TRUE(std::isfinite(rounded.aimed->error));
  ASSERT_EQ(rounded.warnings.size(), 1U);
  EXPECT_EQ(rounded.warnings[0].find("an accuracy of 1e-12 is not reached"), 0U) << rounded.warnings[0];
  setup.duration = 100;
  const RunReport lost = pendula::Run(setup).go();
  ASSERT_EQ(lost.warnings.size(), 1U);
  EXPECT_NE(lost.warnings[0].find("even runs by the smallest useful tolerances part; rows after t = "),
            std::string::npos)
      << lost.warnings[0];
}

/// A motion along a line that hurries once, for a step of 1/1000.
struct HurryingMover : StepView {
  using StepView::at;
  int steps = 0;
  double time() const override { return steps; }
  void read_state(Motion& motion) const override {
    motion = {time(), Eigen::VectorXd::Constant(1, steps + (steps >= 777 ? 500 : 0)), {}};
  }
  Outcome at_full_order(double /*time*/, Motion& /*there*/) override { return {.status = Status::not_converged}; }
  void at(double time, Motion& motion) override { motion = {time, Eigen::VectorXd::Zero(1), {}}; }
};

// Of thousand steps every eighth is kept besides.
TEST(Run, TracksKeepWhereAMotionIsFastest) {
  HurryingMover mover;
  Track track = Track(1).with_fast_places();
  track.begin(mover.state());
  for (mover.steps = 1; mover.steps <= 1000; ++mover.steps) track.follow(mover, {});
  mover.steps = 1000;
  track.finish(mover.state(), true);
  const auto has = [](const Track& of, double time) {
    return std::ranges::any_of(of.states(), [&](const Motion& state) { return state.time == time; });
  };
  EXPECT_TRUE(has(track, 777));
  EXPECT_LT(track.states().size(), 200U);  // measured 168
  Track beside = Track::beside(track);
  beside.begin(mover.state());
  beside.follow(mover, {});
  beside.finish(mover.state(), true);
  EXPECT_TRUE(has(beside, 777));
}

// Trials may part from each other, and the run not part from the finest of them.
TEST(Run, SaysOfNoTimeThatItIsInfinite) {
  RunSetup setup = double_pendulum(10);
  setup.accuracy.error = 1e-6;
  Track track(1);
  track.begin(setup.start);
  Motion last = setup.start;
  last.time = 10;
  track.finish(last, true);
  Trust trust;
  const auto told = detail::of_aim(setup, Separation(*setup.subject, track, track), {.trusted_until = 5}, trust);
  ASSERT_TRUE(told);
  EXPECT_EQ(*told,
            "an accuracy of 1e-06 is not reached: even runs by the smallest useful tolerances part; "
            "rows after t = 5 s may be less accurate");
  EXPECT_EQ(trust.until, 5);
}

// Few stages would take steps without end by tolerances that many stages reach.
TEST(Run, TriesNoToleranceThatItsOrderIsTooLowFor) {
  RunSetup setup = double_pendulum(10);
  setup.options.step = 0;
  setup.start.q = Eigen::Vector2d(3, 3);
  setup.accuracy = {1e-6, false};
  for (const auto& [stages, finest] : {std::pair(1, 1e-6 / 16), std::pair(2, 1e-6 / 256), std::pair(8, 1e-16)}) {
    setup.options.stages = stages;
    const RunReport report = pendula::Run(setup).go();
    EXPECT_GE(report.options.tolerance, finest);
    EXPECT_EQ(report.options.stages, stages);
    EXPECT_EQ(report.warnings.empty(), stages == 8) << stages;
  }
}

// Where chaos leaves no tolerance that is small enough, they would only take time.
TEST(Run, TriesTinyTolerancesByRadauWhereTheyLeadToTheAccuracy) {
  RunSetup setup = double_pendulum(7);
  setup.options = {.method = Method::radau, .stages = 3, .step = 0};
  setup.start.q = Eigen::Vector2d(2.5, 2.5);
  setup.accuracy.error = 1e-9;
  const RunReport reached = pendula::Run(setup).go();
  EXPECT_TRUE(reached.warnings.empty()) << reached.warnings[0];
  EXPECT_LT(reached.options.tolerance, 1e-13);  // measured 7e-15
  setup.duration = 30;
  const RunReport lost = pendula::Run(setup).go();
  EXPECT_EQ(lost.warnings.size(), 1U);
  EXPECT_EQ(lost.options.tolerance, 1e-9 / 1024);  // of order 5, four steps for one
}

// By the tolerance that its first part was run by, whatever its new end is.
TEST(Run, GoesOnByTheAccuracyItBeganWith) {
  RunSetup setup = double_pendulum(5);
  setup.options.step = 0;
  setup.accuracy.error = 1e-6;
  Keeper whole, parts;
  const RunReport expected = run_on(setup, 5.0, 0, whole);
  EXPECT_NE(expected.options.tolerance, setup.options.tolerance);
  const auto tried = static_cast<int>(expected.statistics.steps * 2);  // trials are asked whether to stop, too
  EXPECT_EQ(run_on(setup, 5.0, tried / 4, parts).end, RunEnd::stopped);
  EXPECT_FALSE(parts.kept);
  RunReport part;
  for (int steps = tried; !parts.kept; steps += 5) part = run_on(setup, 5.0, steps, parts);
  EXPECT_EQ(part.end, RunEnd::stopped);
  const RunReport report = run_on(setup, 5.0, 0, parts);
  EXPECT_TRUE(parts.rows == whole.rows);
  EXPECT_EQ(report.options.tolerance, expected.options.tolerance);
  EXPECT_EQ(report.last.q, expected.last.q);
}

TEST(Run, ExpectsTroubleWhereDampingOutrunsTheStep) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector2d::Ones();
  parameters.damping = Eigen::Vector2d(0, 1e6);
  RunSetup setup = double_pendulum(1);
  setup.subject = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  const std::vector<std::string> trouble = pendula::Run(setup).expected_trouble();
  ASSERT_EQ(trouble.size(), 1U);
  EXPECT_EQ(trouble[0].find("damping stops link 2 within 5e-07 s"), 0U) << trouble[0];
}

}  // namespace
}  // namespace pendula::test
