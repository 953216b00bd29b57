// Gauss steps of systems of a generated kernel, one in each lane: each as if it were alone.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/kernels/swinging_atwood.hpp>
#include <pendula/system/kernel_table.hpp>
#include <type_traits>
#include <vector>

#include "support/chain_systems.hpp"
#include "support/growths.hpp"
#include "support/looks.hpp"

namespace pendula::test {
namespace {

using Kernel = kernels::Planar2;
using Atwood = kernels::SwingingAtwood;
using Members = std::vector<SystemMember>;

template <class System, int S = 4, class Register = MemberRegister>
std::vector<ReachedEnd> ends_of(const Members& members, const QueueOptions& options) {
  MemberSystems<LanePack<Register>> dynamics(system_table<System>);
  GaussSystemLanes<S, Register> queue(dynamics, options);
  return ends_by(queue, dynamics.coordinates(), plain_members(members));
}

double distance(const Motion& a, const Motion& b) {
  return std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff());
}

/// By the scalar stepper; a step of 0: by the tolerance.
template <class System>
Motion alone(const SystemMember& member, int stages, double step, double tolerance = 0) {
  GaussStepper<LagrangianSolver<>> stepper(SystemModel(system_table<System>, member.system), stages,
                                           {.tolerance = tolerance}, Iteration::fixed_point);
  EXPECT_TRUE(stepper.start(member.start));
  double left = member.end - member.start.time;
  while (left > 1e-9) {
    EXPECT_TRUE(stepper.step(step > 0 ? std::min(step, left) : left));
    left = member.end - stepper.time();
  }
  return stepper.state();
}

/// Swinging Atwood machines, whose bobs go round, or swing from rest.
struct Machines {
  Machines(std::size_t count, double end, bool goes_round = true) {
    Random random(5);
    numbers.resize(count);
    for (std::array<double, 3>& of : numbers) {
      // counterweight, mass, gravity
      of = {goes_round ? random.uniform(6, 6.5) : 1, random.uniform(0.5, 2), 9.81};
      const Eigen::Vector2d q(random.uniform(0.97, 1.03), random.uniform(0.2, 1));
      const Eigen::Vector2d v(0, goes_round ? std::sqrt(of[0] * of[2] / q[0]) : 0);
      members.push_back({Motion(0, q, v), end, {of.data(), nullptr, {}}});
    }
  }
  Machines(const Machines&) = delete;
  Machines& operator=(const Machines&) = delete;

  std::vector<std::array<double, 3>> numbers;
  Members members;
};

template <class System, int S>
double largest_distance(const Members& members, const QueueOptions& options, double tolerance = 0) {
  const std::vector<ReachedEnd> ends = ends_of<System, S>(members, options);
  double largest = 0;
  for (std::size_t k = 0; k < ends.size(); ++k) {
    EXPECT_EQ(ends[k].status, Status::ok) << k;
    const Motion expected = alone<System>(members[k], tolerance > 0 ? 8 : S, options.step, tolerance);
    largest = std::max(largest, distance(ends[k].motion, expected));
  }
  return largest;
}

class SystemGaussLanesTest : public testing::TestWithParam<bool> {};

// Largest differences seen: 5e-15, 4e-15, 1.4e-14.
TEST_P(SystemGaussLanesTest, StepsOfOneSizeAreThoseOfTheScalarStepper) {
  const ChainSystems systems(19, GetParam(), 1.2501);
  const QueueOptions options{.step = 0.004};
  EXPECT_LT((largest_distance<Kernel, 2>(systems.members, options)), 1e-13);
  EXPECT_LT((largest_distance<Kernel, 4>(systems.members, options)), 1e-13);
  EXPECT_LT((largest_distance<Kernel, 8>(systems.members, options)), 1e-13);
}

// Those of the scalar stepper, but for two digits: free 9.7e-5, 3.8e-7, 1.1e-11, loaded 1.3e-4, 4.4e-8, 4.7e-12; what
// these double pendulums make of errors is their own.
TEST_P(SystemGaussLanesTest, MembersKeepTheirTolerance) {
  const ChainSystems systems(19, GetParam(), 1.5);
  EXPECT_LT((largest_distance<Kernel, 4>(systems.members, {.tolerance = 1e-5}, 1e-13)), 5e-4);
  EXPECT_LT((largest_distance<Kernel, 6>(systems.members, {.tolerance = 1e-8}, 1e-13)), 2e-6);
  EXPECT_LT((largest_distance<Kernel, 8>(systems.members, {.tolerance = 1e-12}, 1e-13)), 5e-11);
}

// Neither others, nor one that is so far from zero that its sines come from elsewhere.
TEST_P(SystemGaussLanesTest, AMemberDependsOnItselfAlone) {
  ChainSystems systems(23, GetParam(), 1);
  systems.members[4].start.q[0] += 2e6 * std::numbers::pi;
  for (const QueueOptions& options : {QueueOptions{.tolerance = 1e-8, .energy_every = 3}, QueueOptions{.step = 0.02}}) {
    const std::vector<ReachedEnd> together = ends_of<Kernel, 6>(systems.members, options);
    for (std::size_t k = 0; k < together.size(); ++k) {
      const ReachedEnd one = ends_of<Kernel, 6>({systems.members[k]}, options)[0];
      EXPECT_EQ(one.status, together[k].status) << k;
      EXPECT_EQ(one.motion.q, together[k].motion.q) << k;
      EXPECT_EQ(one.motion.v, together[k].motion.v) << k;
      EXPECT_EQ(one.steps, together[k].steps) << k;
      EXPECT_EQ(one.energy_error, together[k].energy_error) << k;
      EXPECT_EQ(one.energy_sum, together[k].energy_sum) << k;
    }
  }
}

// Registers of two numbers, as of all: to the last bit.
TEST_P(SystemGaussLanesTest, WidthsAgree) {
  const ChainSystems systems(13, GetParam(), 1);
  const QueueOptions options{.tolerance = 1e-8, .energy_every = 1};
  const std::vector<ReachedEnd> wide = ends_of<Kernel, 4>(systems.members, options);
  const std::vector<ReachedEnd> narrow = ends_of<Kernel, 4, RegisterFor<2>>(systems.members, options);
  for (std::size_t k = 0; k < wide.size(); ++k) {
    EXPECT_EQ(wide[k].motion.q, narrow[k].motion.q) << k;
    EXPECT_EQ(wide[k].motion.v, narrow[k].motion.v) << k;
    EXPECT_EQ(wide[k].energy_error, narrow[k].energy_error) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Loads, SystemGaussLanesTest, testing::Bool(),
                         [](const auto& each) { return each.param ? "loaded" : "free"; });

// Seen: 5.3e-15 and 5.3e-15.
TEST(SystemGaussLanes, StepsOfMachinesAreThoseOfTheScalarStepper) {
  const Machines machines(19, 2.001);
  EXPECT_LT((largest_distance<Atwood, 2>(machines.members, {.step = 0.01})), 1e-13);
  EXPECT_LT((largest_distance<Atwood, 6>(machines.members, {.step = 0.01})), 1e-13);
}

// Seen: 5.0e-6 and 1.0e-10.
TEST(SystemGaussLanes, MachinesKeepTheirTolerance) {
  const Machines machines(19, 3);
  EXPECT_LT((largest_distance<Atwood, 4>(machines.members, {.tolerance = 1e-5}, 1e-13)), 3e-5);
  EXPECT_LT((largest_distance<Atwood, 8>(machines.members, {.tolerance = 1e-11}, 1e-13)), 5e-10);
}

// Errors fall as the 2s-th power of the step.
TEST(SystemGaussLanes, HaveTheirOrder) {
  const Machines machines(8, 0.64, false);
  const auto error = [&]<int S>(std::integral_constant<int, S>, double step) {
    const std::vector<ReachedEnd> ends = ends_of<Atwood, S>(machines.members, {.step = step});
    double sum = 0;
    for (std::size_t k = 0; k < ends.size(); ++k) {
      sum += distance(ends[k].motion, alone<Atwood>(machines.members[k], 8, 0, 1e-15));
    }
    return sum;
  };
  const auto order = [&](auto stages, double step) { return std::log2(error(stages, step) / error(stages, step / 2)); };
  EXPECT_NEAR(order(std::integral_constant<int, 1>(), 0.04), 2, 0.05);  // seen: 1.99
  EXPECT_NEAR(order(std::integral_constant<int, 2>(), 0.08), 4, 0.05);  // 3.98
  EXPECT_NEAR(order(std::integral_constant<int, 3>(), 0.08), 6, 0.05);  // 5.99
  EXPECT_NEAR(order(std::integral_constant<int, 4>(), 0.08), 8, 0.1);   // 7.97
}

/// What tangents of members have grown by at their ends.
template <class Queue, class System>
std::vector<double> growths_of(const Members& members, const QueueOptions& options) {
  MemberSystems<typename Queue::L> dynamics(system_table<System>);
  Growths growths(members.size());
  Queue queue(dynamics, options);
  queue.set_watch(growths);
  for (const ReachedEnd& end : ends_by(queue, dynamics.coordinates(), plain_members(members)))
    EXPECT_EQ(end.status, Status::ok);
  return growths.grown;
}

template <class System>
double largest_growth_distance(const Members& members, const QueueOptions& options) {
  const auto expected = growths_of<SystemTangentLanes<DormandPrince5>, System>(members, {.tolerance = 1e-12});
  const auto found = growths_of<GaussSystemTangentLanes<4>, System>(members, options);
  double largest = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    largest = std::max(largest, std::abs(found[k] - expected[k]));
    const auto alone = growths_of<GaussSystemTangentLanes<4>, System>({members[k]}, options);
    EXPECT_EQ(alone[0], found[k]) << k;
  }
  return largest;
}

// Tangents begin alike by explicit methods, grow alike, and see no other lanes. Seen: 2.5e-12 and 7.3e-13, 1.8e-9 and
// 4.8e-12, of 2 and 0.1 to 2.
TEST(SystemGaussLanes, TangentsGrowAsThoseOfExplicitSteps) {
  const Machines machines(11, 2);
  const ChainSystems systems(11, true, 1.5);
  EXPECT_LT(largest_growth_distance<Atwood>(machines.members, {.tolerance = 1e-10}), 5e-11);
  EXPECT_LT(largest_growth_distance<Atwood>(machines.members, {.step = 0.01}), 5e-11);
  EXPECT_LT(largest_growth_distance<Kernel>(systems.members, {.tolerance = 1e-10}), 2e-8);
  EXPECT_LT(largest_growth_distance<Kernel>(systems.members, {.step = 0.002}), 5e-11);
}

// Over a thousand swings, by steps of one size and chosen ones: errors that do not grow.
TEST(SystemGaussLanes, EnergyStaysWhatItIs) {
  const auto error = [](double end, const QueueOptions& options) {
    const Machines machines(16, end);
    std::vector<double> errors;
    for (const ReachedEnd& reached : ends_of<Atwood, 2>(machines.members, options)) {
      EXPECT_EQ(reached.status, Status::ok);
      errors.push_back(reached.energy_error / reached.energy_sum);
    }
    return *std::max_element(errors.begin(), errors.end());
  };
  for (const QueueOptions& options :
       {QueueOptions{.step = 0.01, .energy_every = 1}, QueueOptions{.tolerance = 1e-5, .energy_every = 1}}) {
    const double early = error(50, options), late = error(1000, options);
    EXPECT_LT(early, 1e-5);        // seen: 1.1e-7, 2.0e-6
    EXPECT_LT(late, 1.5 * early);  // 1.01, 1.09 times
  }
}

// Within a step: as accurate as its end where members look, which steps do not see.
TEST(SystemGaussLanes, LooksHaveTheFullOrder) {
  const ChainSystems systems(11, true, 1);
  const QueueOptions options{.step = 0.02};
  const std::vector<ReachedEnd> expected = ends_of<Kernel>(systems.members, options);
  MemberSystems<LanePack<MemberRegister>> dynamics(system_table<Kernel>);
  GaussSystemLanes<4> queue(dynamics, options);
  Looks looks(systems.members.size(), 2, 0.3);
  queue.set_watch(looks);
  const std::vector<ReachedEnd> ends = ends_by(queue, 2, plain_members(systems.members));
  EXPECT_EQ(looks.failed, 0);
  double look = 0, glance = 0;
  for (std::size_t k = 0; k < ends.size(); ++k) {
    EXPECT_EQ(ends[k].motion.q, expected[k].motion.q) << k;
    SystemMember member = systems.members[k];
    member.end = looks.looked[k].time;
    const Motion exact = alone<Kernel>(member, 8, 0.01);
    look = std::max(look, distance(looks.looked[k], exact));
    glance = std::max(glance, distance(looks.glanced[k], exact));
  }
  EXPECT_LT(look, 1e-9);    // seen: 5.0e-11
  EXPECT_GT(glance, 1e-7);  // seen: 2.2e-7
}

TEST(SystemGaussLanes, FullTurnsAreCounted) {
  ChainSystems systems(9, false, 3);
  for (SystemMember& member : systems.members) member.start.v = Eigen::Vector2d(30, 31);
  const QueueOptions options{.step = 0.002};
  EXPECT_GT((ends_of<Kernel, 6>(systems.members, options)[0].motion.q[0]), 50);
  EXPECT_LT((largest_distance<Kernel, 6>(systems.members, options)), 5e-11);  // 7.6e-12, of 16 turns
}

// One that is no number, and one whose steps are too long for a fixed point.
TEST(SystemGaussLanes, AMemberThatFailsStopsNobodyElse) {
  ChainSystems systems(11, false, 1);
  const QueueOptions options{.step = 0.05};
  const std::vector<ReachedEnd> expected = ends_of<Kernel, 4>(systems.members, options);
  systems.members[2].start.v[1] = std::numeric_limits<double>::quiet_NaN();
  systems.members[6].start.v[0] = 300;
  const std::vector<ReachedEnd> found = ends_of<Kernel, 4>(systems.members, options);
  for (std::size_t k = 0; k < found.size(); ++k) {
    EXPECT_EQ(found[k].status == expected[k].status, k != 2 && k != 6) << k;
    if (k != 2 && k != 6) {
      EXPECT_EQ(found[k].motion.q, expected[k].motion.q) << k;
    }
  }
}

}  // namespace
}  // namespace pendula::test
