// Pairs of crossings that are hardly there: of thresholds a few rounding errors below what a function reaches, and of
// thresholds as far above it, which it never crosses.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/event_location.hpp>
#include <pendula/run/run.hpp>
#include <string>
#include <utility>
#include <vector>

#include "support/random_chain.hpp"

namespace pendula::test {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double depths[] = {10, 30, 100, 1000, 100'000};  // in rounding errors

// --- The search alone ---

/// A function that turns once within a step, rounded as numbers are; its dense output is a cubic through both ends.
struct TurningSight {
  double top, level, curvature, rate, place;
  double ends[2] = {}, slopes[2] = {};

  void measure() {
    for (const int end : {0, 1}) {
      ends[end] = height(end);
      slopes[end] = (height(end + 1e-5) - height(end - 1e-5)) / 2e-5;
    }
  }
  double height(double u) const {
    const double sine = std::sin(rate * (u - place) / 2) / rate;
    return top - curvature * 4 * sine * sine;
  }
  double value(double u) const {
    const double v = 1 - u;
    return ends[0] * (1 + 2 * u) * v * v + slopes[0] * u * v * v + ends[1] * u * u * (1 + 2 * v) -
           slopes[1] * v * u * u - level;
  }
  double exact_value(double u) const { return height(u) - level; }
};

TEST(SignSearch, FindsPairsThatAreFewRoundingErrorsDeep) {
  Random random(5);
  int pairs = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    TurningSight sight{random.uniform(0.2, 3), 0, std::pow(10, random.uniform(-4, 0)), random.uniform(0.2, 3),
                       random.uniform(0.01, 0.99)};
    sight.measure();
    for (const double depth : depths) {
      for (const bool is_passed : {true, false}) {
        sight.level = sight.top + (is_passed ? -1 : 1) * depth * epsilon * std::max(1.0, sight.top);
        const double first = sight.exact_value(0), last = sight.exact_value(1);
        if (first > 0 || last > 0) continue;
        SignSearch<TurningSight> search(sight, 3);
        const std::vector<SignChange> changes = search.find(first, last, 0);
        ASSERT_EQ(changes.size(), is_passed ? 2U : 0U) << trial << ", " << depth;
        pairs += is_passed;
        if (!is_passed) continue;
        EXPECT_LE(changes[0].from, sight.place);
        EXPECT_GE(changes[1].to, sight.place);
      }
    }
  }
  EXPECT_GT(pairs, 14'000);
}

// --- Whole runs ---

struct Occurred {
  std::size_t event;
  bool up;
  Motion motion;
};

class Listener : public Observer {
 public:
  void take(const Row& /*row*/) override {}
  void happen(const EventRow& row) override { all.push_back({std::stoul(row.event.name), row.up, row.row.motion}); }

  std::vector<Occurred> all;
};

std::vector<Occurred> events_of(RunSetup setup, std::vector<Event> events) {
  for (std::size_t k = 0; k < events.size(); ++k) events[k].name = std::to_string(k);
  setup.events = std::move(events);
  Listener listener;
  pendula::Run run(setup);
  run.add(listener);
  const RunReport report = run.go();
  EXPECT_EQ(report.end, RunEnd::complete);
  for (const std::string& warning : report.warnings) ADD_FAILURE() << warning;
  return listener.all;
}

struct Case {
  const char* name;
  RunOptions options;

  friend void PrintTo(const Case& given, std::ostream* out) { *out << given.name; }
};

class GrazingEvents : public ::testing::TestWithParam<Case> {};

// Of angles, where their rates are zero: by methods so exact that both belong to one motion.
TEST_P(GrazingEvents, HappenTwiceOrNever) {
  constexpr int chains = 60;
  struct Threshold {
    double time, near;  // of the turn, and how near to it crossings lie
    bool is_passed;
  };
  Random random(11);
  int pairs = 0;
  for (int chain = 0; chain < chains; ++chain) {
    const int links = 1 + chain % 3;
    RunSetup setup{{GetParam().options, 3},
                   std::make_shared<ChainSubject<Planar>>(random_chain<Planar>(random, links, chain % 2 == 1)),
                   random_state<Planar>(random, links)};
    setup.judged = false;
    std::vector<Event> turning, events;
    for (Eigen::Index k = 0; k < links; ++k) {
      turning.push_back(
          {.value = [k](const Motion& motion) { return motion.v[k]; },
           .enclose = [k](const MotionRange& range) { return Interval(range.least.v[k], range.most.v[k]); }});
    }
    std::vector<Threshold> thresholds;
    for (const Occurred& turn : events_of(setup, turning)) {
      const auto k = static_cast<Eigen::Index>(turn.event);
      const double reached = turn.motion.q[k], outward = turn.up ? -1 : 1;
      for (const double depth : depths) {
        const double off = depth * epsilon * std::max(1.0, std::abs(reached)) * outward;
        for (const bool is_passed : {true, false}) {
          const double level = reached + (is_passed ? -off : off);
          thresholds.push_back({turn.motion.time, std::min(1e-3, 100 * std::sqrt(std::abs(off))), is_passed});
          events.push_back({.value = [k, level](const Motion& motion) { return motion.q[k] - level; },
                            .enclose =
                                [k, level](const MotionRange& range) {
                                  return Interval(range.least.q[k], range.most.q[k]) - Interval(level);
                                }});
        }
      }
    }
    std::vector<int> counts(events.size());
    for (const Occurred& crossing : events_of(setup, events)) {
      const Threshold& threshold = thresholds[crossing.event];
      counts[crossing.event] += std::abs(crossing.motion.time - threshold.time) < threshold.near;
    }
    for (std::size_t n = 0; n < counts.size(); ++n) {
      pairs += thresholds[n].is_passed;
      EXPECT_EQ(counts[n], thresholds[n].is_passed ? 2 : 0)
          << chain << ", " << thresholds[n].time << ", depth " << n % 10 / 2;
    }
  }
  EXPECT_GT(pairs, 2000);
}

INSTANTIATE_TEST_SUITE_P(Methods, GrazingEvents,
                         ::testing::Values(Case{"taylor", {.method = Method::taylor, .tolerance = 1e-12}},
                                           Case{"gauss", {.stages = 8, .step = 0, .tolerance = 1e-10}},
                                           Case{"gauss_by_step", {.stages = 4, .step = 0.005}},
                                           Case{"radau",
                                                {.method = Method::radau, .stages = 3, .step = 0, .tolerance = 1e-8}},
                                           Case{"dopri5", {.method = Method::dopri5, .tolerance = 1e-9}},
                                           Case{"fehlberg78", {.method = Method::fehlberg78, .tolerance = 1e-10}}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace pendula::test
