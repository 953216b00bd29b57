// Many members in one program: each as if it were alone.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <pendula/ensemble/propagate.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/run.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "support/random_chain.hpp"

namespace pendula::test {
namespace {

std::vector<RunSetup> members(int count) {
  Random random(3);
  const RunRequest asked{.options = {.stages = 4, .step = 0, .tolerance = 1e-8}, .duration = 1, .every = 1};
  std::vector<RunSetup> members;
  for (int k = 0; k < count; ++k) {
    const auto subject = std::make_shared<ChainSubject<Planar>>(random_chain<Planar>(random, 2));
    members.push_back({asked, subject, random_state<Planar>(random, 2), false});
  }
  return members;
}

std::vector<RunReport> reports(const std::vector<RunSetup>& all, int threads) {
  std::vector<RunReport> reports(all.size());
  std::mutex guard;
  std::vector<int> seen(all.size());
  const auto observe = [&](std::size_t number, const RunReport& report) {
    const std::scoped_lock lock(guard);
    ++seen.at(number);
    reports.at(number) = report;
  };
  propagate(
      all, threads, observe, [] { return false; }, 3);
  EXPECT_EQ(seen, std::vector<int>(all.size(), 1));
  return reports;
}

TEST(Propagate, MovesEachMemberAsIfItWereAlone) {
  const std::vector<RunSetup> all = members(10);
  const std::vector<RunReport> by_one = reports(all, 1), by_three = reports(all, 3);
  for (std::size_t k = 0; k < all.size(); ++k) {
    ASSERT_TRUE(lane_kind(all[k]));
    const RunReport expected = run_members({&all[k], 1})[0];
    ASSERT_EQ(expected.end, RunEnd::complete);
    for (const std::vector<RunReport>& found : {by_one, by_three}) {
      EXPECT_EQ(found[k].end, RunEnd::complete);
      EXPECT_EQ(found[k].last.q, expected.last.q) << k;
      EXPECT_EQ(found[k].last.v, expected.last.v) << k;
      EXPECT_EQ(found[k].energy_error.largest, expected.energy_error.largest) << k;
    }
  }
}

TEST(Propagate, AMemberThatFailsStopsNobodyElse) {
  std::vector<RunSetup> all = members(7);
  const std::vector<RunReport> expected = reports(all, 1);
  all[2].start.v[0] = std::numeric_limits<double>::infinity();
  const std::vector<RunReport> found = reports(all, 2);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(found[k].end == RunEnd::complete, k != 2) << k;
    if (k != 2) {
      EXPECT_EQ(found[k].last.q, expected[k].last.q);
    }
  }
}

TEST(Propagate, WhatAnObserverThrowsEndsIt) {
  const std::vector<RunSetup> all = members(20);
  const auto refuse = [](std::size_t number, const RunReport&) {
    if (number == 4) throw std::runtime_error("enough");
  };
  for (const int threads : {1, 2}) EXPECT_THROW(propagate(all, threads, refuse), std::runtime_error);
}

TEST(Propagate, OfNobodyIsNothing) {
  EXPECT_TRUE(reports({}, 2).empty());
}

// --- In lanes ---

template <class Space>
class RunsInLanes : public testing::Test {
 protected:
  using SpaceType = Space;

  // Of random chains, from random states.
  static std::vector<RunSetup> setups(int count, int links, const RunOptions& options, double duration) {
    Random random(11);
    std::vector<RunSetup> setups;
    for (int k = 0; k < count; ++k) {
      const Eigen::Index coordinates = Space::dof * links;
      const auto angles = random.matrix<Eigen::VectorXd>(coordinates, 1, -3, 3);
      setups.push_back({{.options = options, .duration = duration, .every = 7},
                        std::make_shared<ChainSubject<Space>>(random_chain<Space>(random, links)),
                        Motion(0, angles, random.matrix<Eigen::VectorXd>(coordinates, 1, -4, 4)),
                        false});
    }
    return setups;
  }

  // A third of them have damping, torques and drives.
  static void load(std::vector<RunSetup>& setups, int links) {
    Random random(5);
    for (std::size_t k = 0; k < setups.size(); k += 3) {
      setups[k].subject = std::make_shared<ChainSubject<Space>>(driven_chain<Space>(random, links));
    }
  }

  // By the scalar chain solver, the method that lanes have.
  static RunReport alone(RunSetup setup) {
    setup.options.solver = Solver::chain;
    setup.options.iteration = Iteration::fixed_point;
    return pendula::Run(std::move(setup)).go();
  }
};

using Spaces = testing::Types<Planar, Spatial>;
TYPED_TEST_SUITE(RunsInLanes, Spaces);

RunOptions constant(double step, int stages = 4) {
  RunOptions options;
  options.stages = stages;
  options.step = step;
  return options;
}

RunOptions chosen(double tolerance) {
  RunOptions options;
  options.step = 0;
  options.stages = 4;
  options.tolerance = tolerance;
  return options;
}

template <class Space>
std::vector<Event> crossings() {
  const auto coordinate = [](Eigen::Index k) { return [k](const Motion& motion) { return std::sin(motion.q[k]); }; };
  std::vector<Event> events;
  events.reserve(2 * Space::dof + 1);
  for (Eigen::Index k = 0; k < 2 * Space::dof; ++k) {
    events.push_back({"q" + std::to_string(k), coordinate(k), k % 2 == 0 ? Direction::both : Direction::up});
  }
  events.push_back({"turns", [](const Motion& motion) { return motion.v[0]; }, Direction::down});
  return events;
}

// Largest differences seen: 1e-13 of the state, 8e-15 of the energy error, 2e-15 s of times.
TYPED_TEST(RunsInLanes, ReportWhatTheScalarSolverWould) {
  std::vector<RunSetup> setups = this->setups(37, 2, constant(2e-3), 2);
  this->load(setups, 2);
  for (RunSetup& setup : setups) setup.events = crossings<TypeParam>();
  const std::vector<RunReport> found = run_members(setups);
  std::int64_t happened = 0;
  for (std::size_t k = 0; k < setups.size(); ++k) {
    ASSERT_TRUE(lane_kind(setups[k]));
    const RunReport expected = this->alone(setups[k]);
    ASSERT_EQ(found[k].end, RunEnd::complete);
    EXPECT_EQ(found[k].last.time, 2);
    EXPECT_LT((found[k].last.q - expected.last.q).cwiseAbs().maxCoeff(), 1e-12) << k;
    EXPECT_LT((found[k].last.v - expected.last.v).cwiseAbs().maxCoeff(), 1e-12) << k;
    EXPECT_EQ(found[k].statistics.steps, expected.statistics.steps);
    EXPECT_EQ(found[k].rows, expected.rows);
    EXPECT_EQ(found[k].energy_error.initial, expected.energy_error.initial);
    EXPECT_EQ(found[k].energy_error.scale, expected.energy_error.scale);
    EXPECT_NEAR(found[k].energy_error.largest, expected.energy_error.largest, 1e-13);
    for (std::size_t e = 0; e < setups[k].events.size(); ++e) {
      EXPECT_EQ(found[k].events[e].count, expected.events[e].count) << k << ", " << setups[k].events[e].name;
      if (expected.events[e].count == 0) continue;
      EXPECT_NEAR(found[k].events[e].first, expected.events[e].first, 1e-13);
      EXPECT_NEAR(found[k].events[e].last, expected.events[e].last, 1e-13);
      happened += found[k].events[e].count;
    }
  }
  EXPECT_GT(happened, 140);
}

// By steps of its own choice, where the iteration of lanes is asked for: the same ones, some of which do not resolve
// how fast a chain can swing. What rounding makes of error estimates, which tiny numbers tell, was seen to make 5e-4 of
// the tolerance, of others 2e-15 of angles.
TYPED_TEST(RunsInLanes, ChooseTheStepsOfTheScalarSolver) {
  RunOptions eight_stages = chosen(1e-9);
  eight_stages.stages = 8;
  for (RunOptions options : {chosen(1e-8), eight_stages}) {
    options.solver = Solver::chain;
    options.iteration = Iteration::fixed_point;
    std::vector<RunSetup> setups = this->setups(37, 2, options, 2);
    this->load(setups, 2);
    const std::vector<RunReport> found = run_members(setups);
    for (std::size_t k = 0; k < setups.size(); ++k) {
      const RunReport expected = this->alone(setups[k]);
      ASSERT_EQ(found[k].end, RunEnd::complete);
      EXPECT_NEAR(double(found[k].statistics.steps), double(expected.statistics.steps), 1) << k;
      EXPECT_LT((found[k].last.q - expected.last.q).cwiseAbs().maxCoeff(), 0.01 * options.tolerance) << k;
      EXPECT_EQ(found[k].last.q, run_members({&setups[k], 1})[0].last.q) << k;
    }
  }
}

TYPED_TEST(RunsInLanes, EndAtAnEvent) {
  std::vector<RunSetup> setups = this->setups(21, 3, constant(5e-3), 3);
  for (RunSetup& setup : setups) {
    setup.events = crossings<TypeParam>();
    setup.events.back().stop = true;
  }
  const std::vector<RunReport> found = run_members(setups);
  int ended = 0;
  for (std::size_t k = 0; k < setups.size(); ++k) {
    const RunReport expected = this->alone(setups[k]);
    ASSERT_EQ(found[k].end, expected.end) << k;
    if (expected.end != RunEnd::event) continue;
    ++ended;
    EXPECT_EQ(found[k].ended_by, setups[k].events.size() - 1);
    EXPECT_NEAR(found[k].last.time, expected.last.time, 1e-12);  // seen: 2e-14
    EXPECT_NEAR(found[k].last.v[0], 0, 1e-12);                   // seen: 7e-14
    EXPECT_EQ(found[k].events.back().count, 1);
    EXPECT_EQ(found[k].events[0].count, expected.events[0].count);
  }
  EXPECT_GT(ended, 5);
}

// Against a Gauss run to round-off, by where bobs are. Largest differences seen: of bobs 3e-11, of times 9e-12 s.
TYPED_TEST(RunsInLanes, ExplicitMethodsGoThereToo) {
  for (const Method method : {Method::fehlberg78, Method::taylor}) {
    RunOptions options = chosen(1e-12);
    options.method = method;
    std::vector<RunSetup> setups = this->setups(11, 2, options, 1);
    for (RunSetup& setup : setups) {
      const Subject& subject = *setup.subject;
      for (Eigen::Index k = 0; k < 2; ++k) {
        setup.events.push_back({"x", [&, k](const Motion& motion) { return subject.observe(motion).points[k]; }});
      }
      for (Event& event : crossings<TypeParam>()) setup.events.push_back(std::move(event));  // of angles, by poles, too
    }
    const std::vector<RunReport> found = run_members(setups);
    std::int64_t happened = 0;
    for (std::size_t k = 0; k < setups.size(); ++k) {
      ASSERT_TRUE(lane_kind(setups[k]));
      RunSetup exact = setups[k];
      exact.options = {.stages = 8, .step = 0, .tolerance = 1e-13};
      const RunReport expected = this->alone(exact);
      ASSERT_EQ(found[k].end, RunEnd::complete);
      const auto points = [&](const RunReport& report) { return setups[k].subject->observe(report.last).points; };
      EXPECT_LT((points(found[k]) - points(expected)).cwiseAbs().maxCoeff(), 1e-8) << name_of(method) << k;
      EXPECT_LT(found[k].energy_error.largest, 5e-9);  // seen: 7e-10
      for (std::size_t e = 0; e < setups[k].events.size(); ++e) {
        EXPECT_EQ(found[k].events[e].count, expected.events[e].count) << k << ", " << setups[k].events[e].name;
        if (expected.events[e].count == 0) continue;
        EXPECT_NEAR(found[k].events[e].first, expected.events[e].first, 1e-9);
        happened += found[k].events[e].count;
      }
    }
    EXPECT_GT(happened, 10) << name_of(method);
  }
}

// Links come by a pole within a step: angles inside it are followed on the way, and go round it as those at its ends
// do.
TEST(RunsInLanesInSpace, FollowAnglesByPolesWithinSteps) {
  const auto subject = std::make_shared<ChainSubject<Spatial>>(equal_chain<Spatial>(2));
  std::vector<RunSetup> setups;
  for (int k = 0; k < 16; ++k) {
    setups.push_back({{.options = {.method = Method::taylor, .step = 0, .tolerance = 1e-10}, .duration = 5},
                      subject,
                      Motion(0, Eigen::Vector4d(-1.5 + 0.2 * k, 0.5, 0.3, 1), Eigen::Vector4d(0.5, -0.3, 0.02, 0.1)),
                      false,
                      crossings<Spatial>()});
  }
  ASSERT_TRUE(lane_kind(setups[0]));
  const std::vector<RunReport> found = run_members(setups);
  std::int64_t happened = 0;
  for (std::size_t k = 0; k < setups.size(); ++k) {
    setups[k].options = {.stages = 8, .solver = Solver::chain, .step = 0, .tolerance = 1e-13};
    const RunReport expected = pendula::Run(setups[k]).go();
    for (std::size_t e = 0; e < setups[k].events.size(); ++e) {
      EXPECT_EQ(found[k].events[e].count, expected.events[e].count) << k << ", " << setups[k].events[e].name;
      happened += found[k].events[e].count;
    }
  }
  EXPECT_GT(happened, 200);
}

// Whose steps are too long for a fixed point is run alone, and reports what it would.
TYPED_TEST(RunsInLanes, WhoCannotBeMovedThereIsRunAlone) {
  std::vector<RunSetup> setups = this->setups(9, 2, constant(0.02), 1);
  setups[4].start.v *= 1e4;
  const std::vector<RunReport> found = run_members(setups);
  const RunReport expected = pendula::Run(setups[4]).go();
  EXPECT_EQ(found[4].end, expected.end);
  EXPECT_EQ(found[4].description.solver, expected.description.solver);
  EXPECT_EQ(found[4].step.status, expected.step.status);
  EXPECT_EQ(found[4].last.q, expected.last.q);
  for (const std::size_t k : {3U, 5U}) EXPECT_EQ(found[k].end, RunEnd::complete);
}

TYPED_TEST(RunsInLanes, ConstantStepsThatDoNotResolveAChainAreTakenAlone) {
  std::vector<RunSetup> setups = this->setups(5, 3, constant(0.5, 4), 2);
  for (RunSetup& setup : setups) {
    setup.start.q *= 1e-3;
    setup.start.v *= 1e-3;
    EXPECT_FALSE(lane_kind(setup));
    setup.options.step = 0.01;
    EXPECT_TRUE(lane_kind(setup));
    setup.options.step = 0.5;
  }
  const std::vector<RunReport> found = run_members(setups);
  for (std::size_t k = 0; k < setups.size(); ++k) {
    const RunReport expected = pendula::Run(setups[k]).go();
    EXPECT_EQ(found[k].last.q, expected.last.q);
    EXPECT_EQ(found[k].last.v, expected.last.v);
  }
}

TYPED_TEST(RunsInLanes, OfSeveralKindsEachGoesWithItsOwn) {
  std::vector<RunSetup> setups = this->setups(12, 2, constant(0.01), 1);
  for (std::size_t k = 0; k < setups.size(); ++k) {
    if (k % 3 == 1) setups[k].options = {.stages = 4, .step = 0, .tolerance = 1e-7};
    if (k % 4 == 2) setups[k].options.stages = 3;  // not compiled for lanes
    setups[k].duration = 0.3 + 0.1 * static_cast<double>(k);
  }
  EXPECT_FALSE(lane_kind(setups[2]));
  const std::vector<RunReport> found = run_members(setups);
  for (std::size_t k = 0; k < setups.size(); ++k) {
    const RunReport expected = run_members({&setups[k], 1})[0];
    EXPECT_EQ(found[k].end, RunEnd::complete);
    EXPECT_EQ(found[k].last.time, setups[k].duration);
    EXPECT_EQ(found[k].last.q, expected.last.q);
    EXPECT_EQ(found[k].statistics.steps, expected.statistics.steps);
  }
}

// Chains with damping, torques and drives, some of which are free among them. Against a Gauss run to round-off. Largest
// differences seen, of fehlberg78 and Gauss steps that are chosen: 1e-11 of bobs, 2e-12 s of times.
TYPED_TEST(RunsInLanes, OfLoadedChainsAreThoseOfOneAlone) {
  using Space = TypeParam;
  Random random(23);
  RunOptions fehlberg = chosen(1e-11), gauss = chosen(1e-11);
  fehlberg.method = Method::fehlberg78;
  std::vector<RunSetup> setups;
  for (int k = 0; k < 21; ++k) {
    const int links = 1 + k % 5;
    const auto subject = std::make_shared<ChainSubject<Space>>(k % 7 == 3 ? random_chain<Space>(random, links)
                                                                          : driven_chain<Space>(random, links));
    setups.push_back({{gauss, 1}, subject, random_state<Space>(random, links), false});
    setups.back().events.push_back({"x", [=](const Motion& motion) { return subject->observe(motion).points[0]; }});
  }
  for (const RunOptions& options : {fehlberg, gauss}) {
    for (RunSetup& setup : setups) setup.options = options;
    const std::vector<RunReport> found = run_members(setups);
    for (std::size_t k = 0; k < setups.size(); ++k) {
      EXPECT_TRUE(lane_kind(setups[k])) << k;
      RunSetup exact = setups[k];
      exact.options = {.stages = 8, .solver = Solver::chain, .step = 0, .tolerance = 1e-13};
      const RunReport expected = pendula::Run(exact).go();
      ASSERT_EQ(found[k].end, RunEnd::complete);
      const auto points = [&](const RunReport& report) { return setups[k].subject->observe(report.last).points; };
      EXPECT_LT((points(found[k]) - points(expected)).cwiseAbs().maxCoeff(), 1e-10) << k;
      ASSERT_EQ(found[k].events[0].count, expected.events[0].count) << k;
      const RunReport one = run_members({&setups[k], 1})[0];
      EXPECT_EQ(found[k].last.q, one.last.q) << k;
      if (expected.events[0].count == 0) continue;
      EXPECT_NEAR(found[k].events[0].first, expected.events[0].first, 1e-10);
    }
  }
}

// A method that was not asked for is taken where it does well: damped ones go by it, one so stiff that it takes too
// many steps as it was asked to.
TEST(RunsOfLoadedChains, ChooseTheQuickestMethodThatWorks) {
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::Vector2d(1, 0.5);
  parameters.lengths = Eigen::Vector2d(1, 0.7);
  parameters.damping = Eigen::Vector2d(0.3, 0.1);
  const auto damped = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  parameters.damping = Eigen::Vector2d(0.3, 3000);
  const auto stiff = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  std::vector<RunSetup> setups;
  for (const auto& subject : {damped, stiff, damped}) {
    setups.push_back({{chosen(1e-6), 5, 1}, subject, Motion(0, Eigen::Vector2d(1, 1.5), Eigen::Vector2d(0, 0)), false});
  }
  const std::vector<RunReport> asked = run_members(setups);
  for (RunSetup& setup : setups) setup.chooses_method = true;
  const std::vector<RunReport> found = run_members(setups);
  for (const std::size_t k : {0U, 2U}) {
    EXPECT_NE(found[k].statistics.steps, asked[k].statistics.steps);
    EXPECT_LT((found[k].last.q - asked[k].last.q).cwiseAbs().maxCoeff(), 2e-7);  // seen: 8e-9
  }
  EXPECT_EQ(found[1].statistics.steps, asked[1].statistics.steps);
  EXPECT_EQ(found[1].last.q, asked[1].last.q);
}

// θ'' = sin ωt. The error estimate of fehlberg78 does not see it.
TEST(RunsOfLoadedChains, SeeForcesThatDependOnTimeAlone) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
  parameters.gravity = 0;
  const double frequency = 10, end = 10;
  parameters.drives = {{.link = 0, .amplitude = Torque<Planar, 1>::Constant(1), .frequency = frequency, .phase = 0}};
  RunSetup setup{{.options = chosen(1e-6), .duration = end, .every = 1},
                 std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters)),
                 Motion(0, Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)),
                 false};
  const double expected = end / frequency - std::sin(frequency * end) / (frequency * frequency);
  for (const bool chooses_method : {false, true}) {
    setup.chooses_method = chooses_method;
    const auto found = run_members(std::vector{setup});
    EXPECT_NEAR(found[0].last.q[0], expected, 1e-6);  // measured 1.4e-9
  }
}

// --- Exponents ---

LyapunovSpectrum exponent_alone(const RunSetup& setup) {
  const auto integrator = setup.subject->make_integrator(setup.options);
  return find_lyapunov_spectrum(
      *integrator, setup.start, std::numeric_limits<double>::infinity(), setup.duration, 1,
      [](const LyapunovProgress&) {}, [] { return false; });
}

template <class Space>
class ExponentsInLanes : public RunsInLanes<Space> {
 protected:
  static std::vector<RunSetup> explicitly(std::vector<RunSetup> setups) {
    for (RunSetup& setup : setups) setup.options = quickest_with_tangents(setup);
    return setups;
  }
};

TYPED_TEST_SUITE(ExponentsInLanes, Spaces);

// Tangents begin alike by all methods, and have grown alike where steps are short. Largest differences seen: 8.9e-9
// 1/s by chosen steps, 8.8e-10 by constant ones, of 0.3 to 6.3; of MEGNO 1.9e-3, which is summed up by steps.
TYPED_TEST(ExponentsInLanes, AreThoseOfOtherSteps) {
  std::vector<RunSetup> setups = this->setups(11, 3, chosen(1e-12), 2);
  this->load(setups, 3);
  for (RunSetup& setup : setups) setup.options.method = Method::fehlberg78;
  const auto expected = exponents_in_lanes(setups);
  for (RunOptions options : {chosen(1e-10), constant(0.002)}) {
    options.stages = 4;
    for (RunSetup& setup : setups) setup.options = options;
    const auto found = exponents_in_lanes(setups);
    for (std::size_t k = 0; k < setups.size(); ++k) {
      ASSERT_TRUE(found[k] && expected[k]);
      EXPECT_NEAR(found[k]->ftle, expected[k]->ftle, 5e-8) << k;
      EXPECT_NEAR(found[k]->megno, expected[k]->megno, 1e-2) << k;
    }
  }
}

// By the derivatives of Gauss steps, of tangents in other coordinates: what is left is what runs of this time do not
// tell. Single members can differ by more than their errors, where one run of a chaotic chain is caught near regular
// motion and the other is not; their means do not. Largest difference seen, by two compilers: 2.4 of its error; of 256
// members, 2.1.
TYPED_TEST(ExponentsInLanes, AreThoseOfGaussSteps) {
  const std::vector<RunSetup> setups = this->setups(8, 2, chosen(1e-6), 100);
  const std::vector<RunSetup> asked = this->explicitly(setups);
  const auto found = exponents_in_lanes(asked);
  double exponents = 0, ftle = 0, squares = 0;  // sums over members, of differences and of squared errors
  for (std::size_t k = 0; k < setups.size(); ++k) {
    const LyapunovSpectrum expected = exponent_alone(setups[k]);
    ASSERT_TRUE(found[k]);
    exponents += found[k]->exponents[0] - expected.exponents[0];
    ftle += found[k]->ftle - expected.ftle;
    squares += found[k]->errors[0] * found[k]->errors[0] + expected.errors[0] * expected.errors[0];
    EXPECT_DOUBLE_EQ(found[k]->duration, 100);
  }
  EXPECT_NEAR(exponents, 0, 4 * std::sqrt(squares));
  EXPECT_NEAR(ftle, 0, 4 * std::sqrt(squares));
}

// Small swings: nothing by exponents, and no more than 2 by MEGNO, which is 0 where all swing alike.
TYPED_TEST(ExponentsInLanes, OfRegularMotionAreZero) {
  std::vector<RunSetup> setups = this->setups(5, 2, chosen(1e-6), 300);
  for (RunSetup& setup : setups) {
    setup.start.q *= 0.05;
    setup.start.v *= 0.05;
  }
  const std::vector<RunSetup> asked = this->explicitly(setups);
  for (const auto& found : exponents_in_lanes(asked)) {
    ASSERT_TRUE(found);
    EXPECT_LT(std::abs(found->exponents[0]), 2 * found->errors[0]);
    EXPECT_LT(found->megno, 2.5);
  }
}

// The motion itself says nothing of how long steps may be.
TYPED_TEST(ExponentsInLanes, OfChainsThatHangStillAreZero) {
  std::vector<RunSetup> setups = this->setups(5, 2, chosen(1e-6), 100);
  for (RunSetup& setup : setups) {
    setup.start.q.setZero();
    setup.start.v.setZero();
  }
  for (const auto& found : exponents_in_lanes(this->explicitly(setups))) {
    ASSERT_TRUE(found);
    EXPECT_LT(std::abs(found->exponents[0]), 2 * found->errors[0]);
    EXPECT_LT(found->megno, 2.5);
  }
}

// To the last bit, by Gauss steps, whose iterations are of all lanes.
TYPED_TEST(ExponentsInLanes, AreOfAMemberAlone) {
  std::vector<RunSetup> setups = this->setups(11, 2, chosen(1e-6), 5);
  this->load(setups, 2);
  for (RunSetup& setup : setups) setup.options.stages = 4;
  const auto together = exponents_in_lanes(setups);
  for (std::size_t k = 0; k < setups.size(); ++k) {
    const auto alone = exponents_in_lanes({&setups[k], 1});
    ASSERT_TRUE(together[k] && alone[0]);
    EXPECT_EQ(together[k]->ftle, alone[0]->ftle) << k;
    EXPECT_EQ(together[k]->megno, alone[0]->megno) << k;
    EXPECT_EQ(together[k]->exponents, alone[0]->exponents) << k;
  }
}

TYPED_TEST(ExponentsInLanes, OfOthersThereAreNone) {
  std::vector<RunSetup> setups = this->setups(7, 2, constant(0.01), 1);
  for (RunSetup& setup : setups) setup.options.iteration = Iteration::newton;
  setups[3].options.method = Method::fehlberg78;
  setups[3].options.step = 0;
  setups[3].options.tolerance = 1e-6;
  const auto found = exponents_in_lanes(setups);
  for (std::size_t k = 0; k < setups.size(); ++k) EXPECT_EQ(found[k].has_value(), k == 3) << k;
  EXPECT_TRUE(exponents_in_lanes(setups, [] { return true; }).empty());
}

// θ'' = −g/l sin θ − b/(m l²) θ̇: that comes to rest, where its exponent is half the damping, and a chain of two links
// that is shaken, which comes to what Gauss steps say. One that is damped faster than steps are long is no exception.
TEST(ExponentsOfLoadedChains, AreFoundInLanes) {
  const auto hung = [](const Eigen::VectorXd& damping, double frequency) {
    ChainParameters<Planar> parameters;
    parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(damping.size());
    parameters.damping = damping;
    if (frequency > 0) {
      parameters.drives = {
          {.link = 0, .amplitude = Torque<Planar, 1>::Constant(3), .frequency = frequency, .phase = 0}};
    }
    return RunSetup{{.options = chosen(1e-6), .duration = 100, .every = 1},
                    std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters)),
                    Motion(0, Eigen::VectorXd::Constant(damping.size(), 1), Eigen::VectorXd::Zero(damping.size())),
                    false};
  };
  std::vector<RunSetup> setups = {hung(Eigen::VectorXd::Constant(1, 0.3), 0),
                                  hung(Eigen::VectorXd::Constant(1, 2.0), 0), hung(Eigen::Vector2d(0.2, 0.1), 3),
                                  hung(Eigen::Vector2d(0.2, 0.1), 5), hung(Eigen::VectorXd::Constant(1, 300.0), 0)};
  setups[4].start.q.setConstant(0.01);
  for (RunSetup& setup : setups) setup.chooses_method = true;
  const auto found = exponents_in_lanes(setups);
  const auto exponent = [&](std::size_t k) { return found[k]->exponents[0]; };
  for (const auto& each : found) ASSERT_TRUE(each);
  EXPECT_NEAR(exponent(0), -0.15, 1e-2);        // seen: 4.5e-3
  EXPECT_NEAR(exponent(1), -1, 5e-3);           // seen: 1.7e-3
  EXPECT_NEAR(exponent(4), -0.03270357, 2e-6);  // seen: 1.5e-7
  for (const std::size_t k : {2U, 3U}) {
    const LyapunovSpectrum expected = exponent_alone(setups[k]);
    const double error = std::hypot(found[k]->errors[0], expected.errors[0]);
    EXPECT_NEAR(exponent(k), expected.exponents[0], 3 * error) << k;  // seen: 0.2 error
    EXPECT_NEAR(found[k]->ftle, expected.ftle, 3 * error) << k;
  }
}

TYPED_TEST(RunsInLanes, LeaveOffWhenAsked) {
  const std::vector<RunSetup> setups = this->setups(20, 2, constant(0.01), 10);
  int asked = 0;
  const std::vector<RunReport> found = run_members(setups, [&] { return ++asked > 50; });
  for (const RunReport& report : found) EXPECT_EQ(report.end, RunEnd::stopped);
  EXPECT_LT(asked, 60);
}

// Chaotic, then at rest, after other numbers of turns by other tolerances: those of which lanes say nothing are right.
// The looks change nothing.
TEST(RunsInLanes, AreDoubtedWhereOthersEndElsewhere) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector2d(1, 1);
  parameters.damping = Eigen::Vector2d(0.1, 0.1);
  const auto subject = std::make_shared<ChainSubject<Planar>>(Chain<Planar>(parameters));
  RunOptions options = chosen(1e-9);
  options.method = Method::fehlberg78;
  std::vector<RunSetup> setups;
  for (int k = 0; k < 16; ++k) {
    setups.push_back(
        {{options, 300, 1}, subject, Motion(0, Eigen::Vector2d(0.2 * k, 0.2 * k), Eigen::Vector2d(0, 0)), false});
  }
  const std::vector<RunReport> plain = run_members(setups);
  std::vector<RunSetup> finest = setups;
  for (RunSetup& setup : finest) setup.options.tolerance = 1e-13;
  const std::vector<RunReport> right = run_members(finest);
  for (RunSetup& setup : setups) setup.judged = true;
  const std::vector<RunReport> found = run_members(setups);
  int wrong = 0, trusted = 0;
  for (std::size_t k = 0; k < setups.size(); ++k) {
    EXPECT_EQ(found[k].last.q, plain[k].last.q) << k;
    EXPECT_EQ(found[k].statistics.steps, plain[k].statistics.steps) << k;
    EXPECT_TRUE(plain[k].warnings.empty());
    EXPECT_EQ(found[k].warnings.empty(), std::isinf(found[k].trust.until)) << k;
    const bool is_right = (found[k].last.q - right[k].last.q).norm() < 1e-3;
    wrong += is_right ? 0 : 1;
    trusted += found[k].warnings.empty() ? 1 : 0;
    EXPECT_TRUE(is_right || !found[k].warnings.empty()) << k;
  }
  EXPECT_GE(wrong, 1);
  EXPECT_GE(trusted, 5);
}

// After a pole two pairs of angles tell one direction.
TEST(ChainSubjects, CompareDirectionsInSpace) {
  ChainParameters<Spatial> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
  const ChainSubject<Spatial> subject{Chain<Spatial>(parameters)};
  const Motion one(0, Eigen::Vector2d(0.3, 1), Eigen::Vector2d(0.5, 0.2));
  const Motion same(0, Eigen::Vector2d(-0.3, 1 + std::acos(-1)), Eigen::Vector2d(-0.5, 0.2));
  const Motion other(0, Eigen::Vector2d(0.3, 1.1), Eigen::Vector2d(0.5, 0.2));
  EXPECT_LT(subject.distance(one, same), 1e-14);  // measured 1.5e-16
  EXPECT_GT(subject.distance(one, other), 0.02);
}

}  // namespace
}  // namespace pendula::test
