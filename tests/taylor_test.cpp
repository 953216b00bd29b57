// Steps of Taylor series, of one chain and of many in lanes.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/run.hpp>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

RunOptions taylor(double tolerance) {
  RunOptions options;
  options.method = Method::taylor;
  options.tolerance = tolerance;
  return options;
}

// By the chain solver, by as many stages as there are.
RunOptions exact() {
  RunOptions options;
  options.stages = 8;
  options.step = 0;
  options.tolerance = 1e-15;
  options.solver = Solver::chain;
  return options;
}

template <class Space>
RunSetup setup_of(const Chain<Space>& chain, const Motion& start, const RunOptions& options, double duration) {
  return {{options, duration}, std::make_shared<ChainSubject<Space>>(chain), start, false};
}

RunReport run_of(RunSetup setup) {
  RunReport report = pendula::Run(std::move(setup)).go();
  EXPECT_EQ(report.end, RunEnd::complete);
  return report;
}

// Of bobs, and of their velocities.
template <class Space>
double difference(const Chain<Space>& chain, const Motion& a, const Motion& b, double duration) {
  const ChainSubject<Space> subject(chain);
  EXPECT_NEAR(a.time, duration, 1e-13 * duration);
  EXPECT_NEAR(b.time, duration, 1e-13 * duration);
  return subject.distance(a, b);
}

template <class Space>
double off(const Chain<Space>& chain, const Motion& start, const RunOptions& options, double duration) {
  const Motion expected = run_of(setup_of(chain, start, exact(), duration)).last;
  return difference(chain, run_of(setup_of(chain, start, options, duration)).last, expected, duration);
}

template <class Space>
class Taylor : public testing::Test {
 protected:
  static Motion start_of(Random& random, int links, double fastest = 3) {
    const Eigen::Index coordinates = Space::dof * links;
    const auto q = random.matrix<Eigen::VectorXd>(coordinates, 1, -3, 3);
    return {0, q, random.matrix<Eigen::VectorXd>(coordinates, 1, -fastest, fastest)};
  }
};

using Spaces = testing::Types<Planar, Spatial>;
TYPED_TEST_SUITE(Taylor, Spaces);

TYPED_TEST(Taylor, GoesWhereGaussStepsGo) {
  Random random(1);
  for (int trial = 0; trial < 30; ++trial) {
    const int links = 1 + trial % 6;
    const Chain<TypeParam> chain = random_chain<TypeParam>(random, links);
    const Motion start = this->start_of(random, links);
    EXPECT_LT(off(chain, start, taylor(1e-14), 1), 4e-12) << trial;  // measured 4e-13
    EXPECT_LT(off(chain, start, taylor(1e-8), 1), 1e-6) << trial;    // measured 1.1e-7
  }
}

// From rest, in a row: angles have but every second coefficient, and where that row is horizontal, every fourth.
TYPED_TEST(Taylor, SeesHowLongStepsMayBeWhereCoefficientsAreMissing) {
  for (const int links : {1, 2, 3}) {
    for (const double angle : {0.5 * std::numbers::pi, 1.0, 3.0}) {
      const auto chain = equal_chain<TypeParam>(links);
      Eigen::VectorXd q = Eigen::VectorXd::Zero(TypeParam::dof * links);
      q.head(links).setConstant(angle);
      const Motion start(0, q, Eigen::VectorXd::Zero(q.size()));
      EXPECT_LT(off(chain, start, taylor(1e-12), 1), 2e-11) << links << ", " << angle;  // measured 2.4e-12
    }
  }
}

// Lengths, masses and times of other sizes are the same motion in other units.
TYPED_TEST(Taylor, KnowsNoUnits) {
  Random random(2);
  const Chain<TypeParam> chain = random_chain<TypeParam>(random, 3);
  const Motion start = this->start_of(random, 3);
  const Motion expected = run_of(setup_of(chain, start, taylor(1e-10), 2)).last;
  for (const double length : {1e-24, 1e-8, 1e-3, 1e6}) {
    ChainParameters<TypeParam> parameters;
    parameters.masses = 1e9 * chain.masses();
    parameters.lengths = length * chain.lengths();
    const double time = std::sqrt(length);
    const RunReport report =
        run_of(setup_of(Chain<TypeParam>(parameters), {0, start.q, start.v / time}, taylor(1e-10), 2 * time));
    EXPECT_LT((report.last.q - expected.q).cwiseAbs().maxCoeff(), 1e-13) << length;         // measured 4e-15
    EXPECT_LT((report.last.v * time - expected.v).cwiseAbs().maxCoeff(), 1e-12) << length;  // measured 4e-14
  }
}

TYPED_TEST(Taylor, KeepsTheEnergyOfLongRuns) {
  Random random(3);
  const Chain<TypeParam> chain = random_chain<TypeParam>(random, 2);
  const RunReport report = run_of(setup_of(chain, this->start_of(random, 2), taylor(1e-15), 1000));
  EXPECT_LT(report.energy_error.largest, 3e-12);  // measured 3.3e-13
}

// There and back again.
TYPED_TEST(Taylor, GoesBack) {
  Random random(4);
  const Chain<TypeParam> chain = random_chain<TypeParam>(random, 2);
  const Motion start = this->start_of(random, 2);
  Motion there = run_of(setup_of(chain, start, taylor(1e-15), 2)).last;
  there.time = 0;
  there.v *= -1;
  Motion back = run_of(setup_of(chain, there, taylor(1e-15), 2)).last;
  back.v *= -1;
  EXPECT_LT(difference(chain, back, {2, start.q, start.v}, 2), 3e-13);  // measured 2.4e-14
}

TYPED_TEST(Taylor, SpinsWithoutGravity) {
  const auto chain = equal_chain<TypeParam>(1, 0);
  Eigen::VectorXd q = Eigen::VectorXd::Constant(TypeParam::dof, 0.4), v = Eigen::VectorXd::Zero(TypeParam::dof);
  v[0] = 5;
  const RunReport report = run_of(setup_of(chain, {0, q, v}, taylor(1e-13), 100));
  EXPECT_NEAR(report.last.q[0], 0.4 + 500, 3e-10);  // measured 2.6e-11
  const RunReport rest = run_of(setup_of(chain, {0, q, 0 * v}, taylor(1e-13), 100));
  EXPECT_EQ(rest.last.q[0], 0.4);
}

// The steps are those of a chain alone, whatever the number of links: written out for two and three. Where there is a
// kernel, one chain moves by its series, and many without loads by those of rods.
TYPED_TEST(Taylor, OfManyInLanesIsThatOfOne) {
  Random random(5);
  for (const int links : {1, 2, 3, 4, 5}) {
    std::vector<RunSetup> setups;
    for (int k = 0; k < 19; ++k) {
      const Chain<TypeParam> chain = random_chain<TypeParam>(random, links);
      setups.push_back(setup_of(chain, this->start_of(random, links), taylor(1e-11), 2));
    }
    const std::vector<RunReport> found = run_members(setups);
    for (std::size_t k = 0; k < setups.size(); ++k) {
      ASSERT_TRUE(lane_kind(setups[k]));
      const RunReport expected = run_of(setups[k]);
      if (series_kernel<TypeParam>(links, false, false) != nullptr) {
        EXPECT_LT(setups[k].subject->distance(found[k].last, expected.last), 5e-8);  // measured 5e-9
        continue;
      }
      EXPECT_EQ(found[k].statistics.steps, expected.statistics.steps);
      EXPECT_EQ(found[k].statistics.rejected_steps, expected.statistics.rejected_steps);
      // Of rates near poles, too; measured 3.1e-13 and 3.1e-11: one alone keeps the rounding errors of its sums.
      EXPECT_LT((found[k].last.q - expected.last.q).cwiseAbs().maxCoeff(), 3e-12) << links << ", " << k;
      EXPECT_LT((found[k].last.v - expected.last.v).cwiseAbs().maxCoeff(), 3e-10) << links << ", " << k;
    }
  }
}

// With loads they move by the series of a kernel: many as one.
TEST(TaylorOfKernels, OfManyInLanesIsThatOfOne) {
  Random random(9);
  for (const int links : {1, 2, 3, 4}) {
    if (series_kernel<Planar>(links, true, true) == nullptr) continue;  // builds for sanitizers have few kernels
    std::vector<RunSetup> setups;
    for (int k = 0; k < 19; ++k) {
      const auto q = random.matrix<Eigen::VectorXd>(links, 1, -3, 3),
                 v = random.matrix<Eigen::VectorXd>(links, 1, -3, 3);
      setups.push_back(setup_of(random_chain<Planar>(random, links, true), {0, q, v}, taylor(1e-11), 2));
    }
    const std::vector<RunReport> found = run_members(setups);
    for (std::size_t k = 0; k < setups.size(); ++k) {
      ASSERT_TRUE(lane_kind(setups[k]));
      ASSERT_FALSE(tangent_lane_kind(setups[k], setups[k].options));
      const RunReport expected = run_of(setups[k]);
      EXPECT_EQ(found[k].statistics.steps, expected.statistics.steps);
      EXPECT_LT((found[k].last.q - expected.last.q).cwiseAbs().maxCoeff(), 1e-12) << links;  // measured 1.1e-13
      EXPECT_LT((found[k].last.v - expected.last.v).cwiseAbs().maxCoeff(), 1e-11) << links;  // measured 1e-12
      RunSetup by_gauss = setups[k];
      by_gauss.options = exact();
      EXPECT_LT(setups[k].subject->distance(found[k].last, run_of(by_gauss).last), 3e-9) << links;  // measured 4e-10
    }
  }
}

// Where it hangs after a turn, angles are rounded by more than it still moves.
TEST(TaylorOfKernels, ComesToRestAwayFromZero) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(2);
  parameters.damping = Eigen::Vector2d(0.2, 0.8);
  const double turn = 2 * std::numbers::pi;
  const Motion start(0, Eigen::Vector2d(turn + 0.5, turn - 0.3), Eigen::Vector2d::Zero());
  const RunReport report = run_of(setup_of(Chain<Planar>(parameters), start, taylor(1e-11), 1000));
  EXPECT_LT(report.statistics.steps + report.statistics.rejected_steps, 6000);            // measured 2620
  EXPECT_LT((report.last.q - Eigen::Vector2d(turn, turn)).cwiseAbs().maxCoeff(), 1e-14);  // measured 9e-16
}

TYPED_TEST(Taylor, TangentsInLanesGrowAsThoseOfOtherMethods) {
  Random random(7);
  std::vector<RunSetup> setups;
  for (int k = 0; k < 11; ++k) {
    const Chain<TypeParam> chain = random_chain<TypeParam>(random, 1 + k / 6);
    setups.push_back(setup_of(chain, this->start_of(random, 1 + k / 6), taylor(1e-12), 2));
  }
  const auto found = exponents_in_lanes(setups);
  for (RunSetup& setup : setups) setup.options.method = Method::fehlberg78;
  const auto expected = exponents_in_lanes(setups);
  for (std::size_t k = 0; k < setups.size(); ++k) {
    ASSERT_TRUE(found[k] && expected[k]);
    EXPECT_NEAR(found[k]->ftle, expected[k]->ftle, 3e-10) << k;  // measured 1.8e-11
  }
}

// Of what "auto" makes of a run by Gauss steps: in lanes with others, although each has a length of its own, and by
// steps that lose no more of the energy the longer it is.
TYPED_TEST(Taylor, IsTheQuickestForShortChainsHoweverLongTheyAreMoved) {
  Random random(8);
  std::vector<RunSetup> setups;
  std::set<LaneKind> kinds, kinds_with_tangents;
  for (int k = 0; k < 24; ++k) {
    const Chain<TypeParam> chain = random_chain<TypeParam>(random, 2);
    setups.push_back(setup_of(chain, this->start_of(random, 2, 10), exact(), 200));
    setups.back().options.tolerance = 1e-6;
    setups.back().chooses_method = true;
    setups.back().events = {{"turns", [](const Motion& motion) { return motion.v[0]; }}};
    const RunOptions options = quickest_in_lanes(setups.back());
    EXPECT_EQ(options.method, Method::taylor);
    kinds.insert(*lane_kind(setups.back(), options));
    kinds_with_tangents.insert(lane_kind(setups.back(), quickest_with_tangents(setups.back())).value_or(LaneKind()));
  }
  EXPECT_LE(kinds.size(), 2U);
  EXPECT_LE(kinds_with_tangents.size(), 2U);
  std::int64_t happened = 0;
  for (const RunReport& report : run_members(setups)) {
    EXPECT_EQ(report.end, RunEnd::complete);
    happened += report.events[0].count;
    EXPECT_LT(report.energy_error.largest, 1e-6);  // measured 2.9e-7
  }
  EXPECT_GT(happened, 1000);
}

// A vertical plane is one, whatever its direction: through both poles of (θ, φ).
TEST(TaylorInSpace, PassesPoles) {
  const auto chain = equal_chain<Spatial>(2);
  const auto plane = equal_chain<Planar>(2);
  for (const double phi : {0.0, 0.7}) {
    Eigen::VectorXd q(4), v(4);
    q << 2.0, 2.5, phi, phi;
    v << 3.0, 6.0, 0, 0;
    const RunReport space = run_of(setup_of(chain, {0, q, v}, taylor(1e-14), 3));
    const RunReport flat = run_of(setup_of(plane, {0, q.head(2), v.head(2)}, taylor(1e-14), 3));
    EXPECT_LT((space.last.q.head(2) - flat.last.q).cwiseAbs().maxCoeff(), 1e-13);  // measured 5e-15
    EXPECT_LT((space.last.q.tail(2) - q.tail(2)).cwiseAbs().maxCoeff(), 1e-13);    // measured 1.4e-15
    EXPECT_LT((space.last.v.head(2) - flat.last.v).cwiseAbs().maxCoeff(), 1e-13);  // measured 1.1e-14
  }
}

TEST(TaylorInSpace, StartsAtAPole) {
  const auto chain = equal_chain<Spatial>(1);
  const Motion start(0, Eigen::Vector2d(0, 0.3), Eigen::Vector2d(3, 1));
  EXPECT_LT(off(chain, start, taylor(1e-13), 1), 1e-14);  // measured 5e-16
}

template <class Make>
std::string refusal(Make make) {
  try {
    make();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(TaylorRefuses, WhatItHasNoSeriesOf) {
  Random random(6);
  const std::string loaded = refusal([&] { make_integrator(random_chain<Spatial>(random, 2, true), taylor(1e-9)); });
  EXPECT_EQ(loaded.find("method: taylor takes damping, torques and drives where there is a planar kernel"), 0U)
      << loaded;
  const std::string vague = refusal([&] { make_integrator(equal_chain<Planar>(2), taylor(0)); });
  EXPECT_EQ(vague.find("tolerance: expected a positive number"), 0U) << vague;
}

TEST(TaylorRefuses, StatesThatAreNotFinite) {
  const auto integrator = make_integrator(equal_chain<Planar>(2), taylor(1e-9));
  const Motion start(0, Eigen::Vector2d(1, std::nan("")), Eigen::Vector2d::Zero());
  EXPECT_EQ(integrator->start(start).status, Status::not_finite);
}

}  // namespace
}  // namespace pendula::test
