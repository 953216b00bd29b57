// Events whose expressions are narrow, or turn faster than the motion, as scenarios have them: every change of sign,
// once.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <numbers>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/run.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/event_reader.hpp"
#include "support/random_chain.hpp"

namespace pendula::test {
namespace {

/// When events happened, by their names.
class Times : public Observer {
 public:
  void take(const Row& /*row*/) override {}
  void happen(const EventRow& row) override { of[row.event.name].push_back(row.row.motion.time); }

  std::map<std::string, std::vector<double>> of;
};

struct Watched {
  std::map<std::string, std::vector<double>> times;
  RunReport report;

  std::vector<double> of(const std::string& name) const {
    const auto found = times.find(name);
    return found == times.end() ? std::vector<double>() : found->second;
  }
};

Watched watch(RunSetup setup, const std::vector<io::EventPlan>& plans) {
  setup.judged = false;
  setup.events = io::events_of(plans, setup.subject, setup.start);
  Times times;
  pendula::Run run(setup);
  run.add(times);
  const RunReport report = run.go();
  EXPECT_EQ(report.end, RunEnd::complete);
  for (const std::string& warning : report.warnings) ADD_FAILURE() << warning;
  return {times.of, report};
}

io::EventPlan plan(const std::string& name, const std::string& when) {
  io::EventPlan plan;
  plan.name = name;
  plan.when = when;
  return plan;
}

/// Rods that go round and round: every column passes most of its values, quickly.
template <class Space>
RunSetup whirling(Random& random, int links, const RunOptions& options) {
  const Eigen::VectorXd rates = random.matrix<Eigen::VectorXd>(Space::dof * links, 1, 5, 8);
  Eigen::VectorXd angles = random.matrix<Eigen::VectorXd>(Space::dof * links, 1, 0.5, 2.5);
  return {{options, 3},
          std::make_shared<ChainSubject<Space>>(random_chain<Space>(random, links)),
          Motion(0, angles, rates)};
}

/// An expression that is narrow at a level of a column, and the levels where it crosses zero.
struct Narrow {
  std::string when;
  std::vector<double> levels;
};

Narrow narrow(int kind, const std::string& column, double level, double width) {
  const std::string off = "(" + column + " - " + shortest(level) + ")", part = off + "/" + shortest(width);
  const std::vector<double> beside = {level - width, level + width};
  switch (kind) {
    case 0: {
      const double half = width * std::sqrt(std::numbers::ln2);
      return {"exp(-(" + part + ")^2) - 0.5", {level - half, level + half}};
    }
    case 1:
      return {shortest(width) + " - abs(" + off + ")", beside};
    case 2:
      return {"sqrt(abs(" + off + ")) - sqrt(" + shortest(width) + ")", beside};
    case 3:
      return {"1/(1 + (" + part + ")^2) - 0.5", beside};
    case 4:
      return {"tanh(" + part + ")", {level}};
    case 5:
      return {"sign(" + off + ") + 0.5", {level}};
    case 6:
      return {"abs(" + off + ") < " + shortest(width) + " ? 1 : -1", beside};
    case 7:
      return {"floor(" + part + ") + 0.5", {level}};
    default:
      return {"min(1 - abs(" + part + "), 0.5)", beside};
  }
}
constexpr int kinds = 9;

struct Case {
  const char* name;
  RunOptions options;
  double off;  // [s] of instants that are looked for in two ways: measured 4e-15, of the last one 2e-13
  // Of a crossing, in the mean, with those of the plain expression: measured 11 to 17.3.
  std::int64_t looks = 20;

  friend void PrintTo(const Case& given, std::ostream* out) { *out << given.name; }
};

class NarrowEvents : public ::testing::TestWithParam<Case> {};

/// What they cross zero at is looked for as well, by expressions that are as slow as the motion.
template <class Space>
std::size_t compare_with_levels(unsigned seed, const std::vector<std::string>& columns, int links, const Case& given,
                                EventCost& cost) {
  Random random(seed);
  std::vector<io::EventPlan> plans;
  std::vector<Narrow> all;
  for (int kind = 0; kind < kinds; ++kind) {
    const auto which = static_cast<std::size_t>(random.uniform(0, static_cast<double>(columns.size()) - 1e-9));
    const double width = std::pow(10, random.uniform(-6, -1));
    all.push_back(narrow(kind, columns[which], random.uniform(-0.6, 0.6), width));
    const std::string name = std::to_string(kind);
    plans.push_back(plan(name, all.back().when));
    for (std::size_t k = 0; k < all.back().levels.size(); ++k) {
      const std::string level = shortest(all.back().levels[k]);
      plans.push_back(plan(name + "_" + std::to_string(k), columns[which] + " - " + level));
    }
  }
  const Watched watched = watch(whirling<Space>(random, links, given.options), plans);
  std::size_t found = 0;
  for (int kind = 0; kind < kinds; ++kind) {
    const std::string name = std::to_string(kind);
    const Narrow& narrow = all[static_cast<std::size_t>(kind)];
    std::vector<double> expected;
    for (std::size_t k = 0; k < narrow.levels.size(); ++k) {
      for (const double time : watched.of(name + "_" + std::to_string(k))) expected.push_back(time);
    }
    std::ranges::sort(expected);
    const std::vector<double> got = watched.of(name);
    EXPECT_EQ(got.size(), expected.size()) << "seed " << seed << ": " << narrow.when;
    for (std::size_t k = 0; k < std::min(got.size(), expected.size()); ++k) {
      EXPECT_NEAR(got[k], expected[k], given.off) << "seed " << seed << ": " << narrow.when;
    }
    found += got.size();
  }
  cost.glances += watched.report.event_cost.glances;
  cost.looks += watched.report.event_cost.looks;
  return found;
}

TEST_P(NarrowEvents, AreAllFound) {
  EventCost cost;
  std::size_t found = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    found += compare_with_levels<Planar>(seed, {"x_1", "y_1", "theta_1"}, 1, GetParam(), cost);
    found += compare_with_levels<Planar>(seed, {"x_1", "y_1", "x_2", "y_2"}, 2, GetParam(), cost);
    found += compare_with_levels<Spatial>(seed, {"x_1", "y_1", "z_1"}, 1, GetParam(), cost);
  }
  // Of a last step that was cut the polynomial of eight stages did not tell where one of these changes.
  found += compare_with_levels<Planar>(1245, {"x_1", "y_1", "x_2", "y_2"}, 2, GetParam(), cost);
  EXPECT_GT(found, 2000U);
  EXPECT_LE(cost.looks, GetParam().looks * static_cast<std::int64_t>(found));
}

INSTANTIATE_TEST_SUITE_P(Methods, NarrowEvents,
                         ::testing::Values(Case{"gauss", {.stages = 8, .step = 0, .tolerance = 1e-10}, 1e-13},
                                           Case{"gauss_4", {.stages = 4, .step = 0.01}, 1e-13},
                                           Case{"gauss_2", {.stages = 2, .step = 0.002}, 1e-13},
                                           Case{"radau", {.method = Method::radau, .stages = 3, .step = 0.02}, 1e-13},
                                           Case{"rk4", {.method = Method::rk4, .step = 0.01}, 1e-13},
                                           Case{"dopri5", {.method = Method::dopri5, .tolerance = 1e-9}, 1e-13},
                                           Case{"fehlberg78", {.method = Method::fehlberg78, .tolerance = 1e-9}, 1e-13},
                                           Case{"taylor", {.method = Method::taylor, .tolerance = 1e-10}, 1e-12}),
                         [](const auto& test) { return std::string(test.param.name); });

// Of members that move side by side, each in its lane, and of ones whose steps lanes do not look into at full order.
TEST(NarrowEventsInLanes, AreAllFound) {
  const RunOptions gauss{.stages = 4, .step = 0.01}, fehlberg{.method = Method::fehlberg78, .tolerance = 1e-9};
  for (const RunOptions& options : {gauss, fehlberg}) {
    std::vector<RunSetup> setups;
    std::vector<std::vector<std::pair<std::size_t, std::size_t>>> levels;  // of each member's narrow events
    Random random(5);
    for (int member = 0; member < 12; ++member) {
      RunSetup setup = whirling<Planar>(random, 2, options);
      std::vector<io::EventPlan> plans;
      levels.emplace_back();
      for (int kind = 0; kind < kinds; ++kind) {
        const std::string column = kind % 2 == 0 ? "x_1" : "y_2";
        const Narrow asked = narrow(kind, column, random.uniform(-0.6, 0.6), std::pow(10, random.uniform(-6, -1)));
        plans.push_back(plan(std::to_string(plans.size()), asked.when));
        for (const double level : asked.levels) {
          plans.push_back(plan(std::to_string(plans.size()), column + " - " + shortest(level)));
        }
        levels.back().emplace_back(plans.size() - 1 - asked.levels.size(), asked.levels.size());
      }
      setup.judged = false;
      setup.events = io::events_of(plans, setup.subject, setup.start);
      setups.push_back(setup);
    }
    const std::vector<RunReport> reports = run_members(setups);
    std::int64_t found = 0;
    for (std::size_t k = 0; k < setups.size(); ++k) {
      ASSERT_TRUE(lane_kind(setups[k]));
      EXPECT_EQ(reports[k].end, RunEnd::complete);
      EXPECT_TRUE(reports[k].warnings.empty());
      for (const auto& [event, count] : levels[k]) {
        std::int64_t expected = 0;
        for (std::size_t level = 1; level <= count; ++level) expected += reports[k].events[event + level].count;
        EXPECT_EQ(reports[k].events[event].count, expected) << options.method << ' ' << k << ' ' << event;
        found += expected;
      }
    }
    EXPECT_GT(found, 500);
  }
}

// --- Bounds of the states of a step ---

struct Bounding {
  const char* name;
  RunOptions options;

  friend void PrintTo(const Bounding& given, std::ostream* out) { *out << given.name; }
};

class EventsWithinBounds : public ::testing::TestWithParam<Bounding> {
 protected:
  /// Runs with events by all columns with and without bounds. `tightness`: the largest excursion, in bounds.
  template <class Space>
  void compare(Random& random, int chain) {
    const int links = 1 + chain % 3;
    RunSetup setup{{options(), 5},
                   std::make_shared<ChainSubject<Space>>(random_chain<Space>(random, links, chain % 2 == 1)),
                   random_state<Space>(random, links)};
    setup.judged = false;
    const std::string last = std::to_string(links), turns = Space::dof == 1 ? "theta" : "phi";
    const auto level = [&] { return shortest(random.uniform(-2, 2)); };
    const std::vector<io::EventPlan> plans = {plan("a", "theta_1 - " + level()),
                                              plan("b", turns + "_dot_" + last + " - " + level()),
                                              plan("c", turns + "_1*theta_dot_" + last + " - " + level()),
                                              plan("d", "sin(" + turns + "_1 - theta_dot_" + last + ") - t/20"),
                                              plan("e", "sqrt(abs(theta_" + last + ")) - " + level()),
                                              plan("f", turns + "_1 > " + level() + " ? 1 : -1")};
    setup.events = io::events_of(plans, setup.subject, setup.start);
    const RunReport bounded = pendula::Run(setup).go();
    for (Event& event : setup.events) {
      ASSERT_TRUE(event.enclose);
      event.enclose = nullptr;
    }
    const RunReport searched = pendula::Run(setup).go();
    for (std::size_t k = 0; k < plans.size(); ++k) {
      EXPECT_EQ(bounded.events[k].count, searched.events[k].count) << chain << ": " << plans[k].when;
      found += searched.events[k].count;
      if (searched.events[k].count == 0) continue;
      constexpr double off = 5e-15;  // s; by the velocity form measured 8.9e-16, one rounding, else 0
      EXPECT_NEAR(bounded.events[k].first, searched.events[k].first, off) << chain << ": " << plans[k].when;
      EXPECT_NEAR(bounded.events[k].last, searched.events[k].last, off) << chain << ": " << plans[k].when;
    }
    with += bounded.event_cost.glances;
    without += searched.event_cost.glances;
    measure(setup);
  }

  /// No state of a step lies beyond its bounds.
  void measure(const RunSetup& setup) {
    const auto integrator = setup.subject->make_integrator(setup.options);
    integrator->remember_steps(true);
    ASSERT_TRUE(integrator->start(setup.start));
    Motion begin = setup.start, farthest = begin, there;
    while (integrator->time() < setup.duration / 4) {
      ASSERT_TRUE(integrator->step(is_adaptive(setup.options) ? 1 : setup.options.step));
      const double h = integrator->time() - begin.time;
      ASSERT_TRUE(integrator->bound_excursions(farthest));
      for (const double share : {0.05, 0.3, 0.5, 0.8, 0.97, 1.0}) {
        ASSERT_TRUE(integrator->at_full_order(begin.time + share * h, there));
        for (const auto& [at, from, bound] :
             {std::tuple(&there.q, &begin.q, &farthest.q), std::tuple(&there.v, &begin.v, &farthest.v)}) {
          const Eigen::ArrayXd rounding = 8 * epsilon * (bound->array() + from->cwiseAbs().maxCoeff());
          tightness = std::max(tightness, ((*at - *from).array().abs() / (bound->array() + rounding)).maxCoeff());
        }
      }
      begin = integrator->state();
    }
  }

  static const RunOptions& options() { return GetParam().options; }

  static constexpr double epsilon = std::numeric_limits<double>::epsilon();
  std::int64_t found = 0, with = 0, without = 0;
  double tightness = 0;
};

// Bounds of a step's states exclude what does not happen, and nothing else.
TEST_P(EventsWithinBounds, AreThoseThatAreFoundWithout) {
  Random random(7);
  for (int chain = 0; chain < 20; ++chain) {
    compare<Planar>(random, chain);
    const bool is_kernel =
        options().method == Method::taylor || options().solver == Solver::dense || options().form == Form::velocity;
    if (!is_kernel) compare<Spatial>(random, chain);
  }
  EXPECT_GT(found, 600);
  EXPECT_LE(tightness, 1);  // of two stages measured 0.200, else 0.997 to 0.99999998
  EXPECT_GE(tightness, 0.1);
  EXPECT_LE(with, without);  // measured 0.62 to 0.99 of it, as all events of a step share its glances; two stages: 1
}

// What is damped long before the first stage of a step.
TEST(EventsWithinBoundsOfStiffSteps, AreThoseThatAreFoundWithout) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
  parameters.damping = Eigen::VectorXd::Constant(1, 1e5);
  const auto subject = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);
  for (const RunOptions& options : {RunOptions{.method = Method::radau, .stages = 3, .step = 0.1},
                                    RunOptions{.method = Method::radau, .stages = 2, .step = 0.01},
                                    RunOptions{.stages = 2, .step = 0.1}, RunOptions{.stages = 3, .step = 0.1}}) {
    RunSetup setup{{options, 1}, subject, Motion(0, one, 5 * one)};
    setup.judged = false;
    setup.events =
        io::events_of({plan("a", "theta_dot_1 - 2"), plan("b", "theta_dot_1 - 4.9"), plan("c", "theta_dot_1 + 1")},
                      setup.subject, setup.start);
    const RunReport bounded = pendula::Run(setup).go();
    for (Event& event : setup.events) event.enclose = nullptr;
    const RunReport searched = pendula::Run(setup).go();
    for (std::size_t k = 0; k < setup.events.size(); ++k) {
      EXPECT_EQ(bounded.events[k].count, searched.events[k].count) << options.method << options.stages << ' ' << k;
      if (searched.events[k].count == 0) continue;
      EXPECT_EQ(bounded.events[k].first, searched.events[k].first) << options.method << options.stages << ' ' << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Methods, EventsWithinBounds,
    ::testing::Values(Bounding{"taylor", {.method = Method::taylor, .tolerance = 1e-9}},
                      Bounding{"gauss", {.stages = 8, .step = 0, .tolerance = 1e-9}},
                      Bounding{"gauss_coarse", {.stages = 8, .step = 0, .tolerance = 1e-5}},
                      Bounding{"gauss_4", {.stages = 4, .step = 0.02}},
                      Bounding{"gauss_2", {.stages = 2, .step = 0.005}},
                      Bounding{"radau", {.method = Method::radau, .stages = 3, .step = 0.01}},
                      Bounding{"dense", {.stages = 8, .solver = Solver::dense, .step = 0, .tolerance = 1e-9}},
                      Bounding{"dense_2", {.stages = 2, .solver = Solver::dense, .step = 0.005}},
                      Bounding{"velocity", {.stages = 4, .form = Form::velocity, .step = 0.02}}),
    [](const auto& test) { return std::string(test.param.name); });

/// A motion whose steps are long.
RunSetup slow_motion(const RunOptions& options, double duration) {
  const Eigen::VectorXd one = Eigen::VectorXd::Constant(1, 0.1);
  return {{options, duration}, std::make_shared<ChainSubject<Planar>>(equal_chain<Planar>(1)), Motion(0, one, one)};
}

const std::vector<RunOptions> few_methods = {{.stages = 8, .step = 0, .tolerance = 1e-9},
                                             {.method = Method::radau, .stages = 3, .step = 0.05},
                                             {.method = Method::dopri5, .tolerance = 1e-6},
                                             {.method = Method::fehlberg78, .tolerance = 1e-9}};

TEST(EventsOfTime, ThatHardlyReachZeroAreAllFound) {
  Random random(1);
  double off = 0;
  std::size_t found = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const double turns = std::pow(10, random.uniform(0, 3)), phase = random.uniform(-3, 3);
    const double depth = std::pow(10, random.uniform(-12, -3)), duration = std::min(3.0, 300 / turns);
    const double least = 1 - depth, half = std::acos(least);
    const std::string when = "cos(" + shortest(turns) + "*t + " + shortest(phase) + ") - " + shortest(least);
    const std::string misses = "cos(" + shortest(turns) + "*t + " + shortest(phase) + ") - " + shortest(1 + depth);
    std::vector<double> expected;
    for (int k = -1; k < 60; ++k) {
      for (const double side : {-half, half}) {
        const double time = (2 * std::numbers::pi * k + side - phase) / turns;
        if (time > 0 && time < duration) expected.push_back(time);
      }
    }
    for (const RunOptions& options : few_methods) {
      const Watched watched = watch(slow_motion(options, duration), {plan("reaches", when), plan("misses", misses)});
      const std::vector<double> got = watched.of("reaches");
      EXPECT_EQ(watched.of("misses").size(), 0U) << misses;
      ASSERT_EQ(got.size(), expected.size()) << when << " by " << options.method;
      for (std::size_t k = 0; k < got.size(); ++k) off = std::max(off, std::abs(got[k] - expected[k]) * turns * half);
      found += got.size();
    }
  }
  EXPECT_LT(off, 1e-13);  // in radians times how steep it is: measured 8e-15
  EXPECT_GT(found, 1000U);
}

// Up, and soon afterwards down by a jump.
TEST(EventsOfTime, BesideAJumpAreAllFound) {
  Random random(2);
  for (int trial = 0; trial < 100; ++trial) {
    const double period = std::pow(10, random.uniform(-1.5, 0)),
                 before = std::pow(10, random.uniform(-10, -1)) * period;
    const double level = period - before;
    const std::string when = "fmod(t, " + shortest(period) + ") - " + shortest(level);
    std::vector<double> expected;
    for (int k = 0; k < 100; ++k) {
      for (const double time : {k * period + level, (k + 1) * period}) {
        if (time < 3) expected.push_back(time);
      }
    }
    for (const RunOptions& options : few_methods) {
      const std::vector<double> got = watch(slow_motion(options, 3), {plan("saw", when)}).of("saw");
      ASSERT_EQ(got.size(), expected.size()) << when << " by " << options.method;
      for (std::size_t k = 0; k < got.size(); ++k) EXPECT_NEAR(got[k], expected[k], 4e-15) << when;  // measured 1.8e-15
    }
  }
}

TEST(EventsOfTime, ThatLastForAlmostNoTimeAreFound) {
  for (const RunOptions& options : few_methods) {
    for (const double width : {1e-2, 1e-5, 1e-9, 1e-12}) {
      const std::string off = "((t - 1.2345)/" + shortest(width) + ")";
      const Watched watched = watch(slow_motion(options, 3), {plan("pulse", "exp(-" + off + "^2) - 0.5"),
                                                              plan("window", "abs(" + off + ") < 1 ? 1 : -1"),
                                                              plan("jump", "tanh(" + off + ") + 0.5")});
      const double half = width * std::sqrt(std::numbers::ln2);
      ASSERT_EQ(watched.of("pulse").size(), 2U) << width;
      EXPECT_NEAR(watched.of("pulse")[0], 1.2345 - half, 1e-15);  // measured 9e-16
      EXPECT_NEAR(watched.of("pulse")[1], 1.2345 + half, 1e-15);
      EXPECT_EQ(watched.of("window").size(), 2U) << width;
      EXPECT_EQ(watched.of("jump").size(), 1U) << width;
      EXPECT_LE(watched.report.event_cost.looks, 6);  // a state for each, and no more
      EXPECT_EQ(watched.report.event_cost.glances, 0);
    }
  }
}

// More often in a step than can be followed: that is told, once.
TEST(EventsOfTime, ThatTurnTooOftenAreToldOf) {
  RunSetup setup = slow_motion(few_methods[0], 3);
  setup.judged = false;
  setup.events = io::events_of({plan("hum", "sin(1e6*t)")}, setup.subject, setup.start);
  const RunReport report = pendula::Run(setup).go();
  ASSERT_EQ(report.warnings.size(), 1U);
  EXPECT_TRUE(report.warnings[0].starts_with("event hum: changes too often for the steps before t = "));
}

}  // namespace
}  // namespace pendula::test
