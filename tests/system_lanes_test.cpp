// Systems of a generated kernel, one in each lane: each as if it were alone.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/lanes/lane_dual_functions.hpp>
#include <pendula/lanes/lane_functions.hpp>
#include <pendula/lanes/lane_kernel.hpp>
#include <pendula/lanes/lane_queue.hpp>
#include <pendula/numeric/dual.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/simulation.hpp>
#include <vector>

#include "support/chain_systems.hpp"

namespace pendula::test {
namespace {

using Kernel = kernels::Planar2;

template <class Register = MemberRegister>
std::vector<LaneEnd> ends_of(const std::vector<LaneSystemMember>& members, const LaneOptions& options) {
  LaneKernel<Kernel, Register> kernel;
  std::vector<LaneEnd> ends(members.size());
  SystemLanes<DormandPrince5, Register> queue(kernel, options);
  queue.run(members, ends);
  return ends;
}

double distance(const Motion& a, const Motion& b) {
  return std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff());
}

Motion alone(const Chain<Planar>& chain, const LaneSystemMember& member) {
  RunOptions options{.stages = 8, .solver = Solver::chain, .step = 0};
  options.tolerance = 1e-13;
  const auto integrator = make_integrator(chain, options);
  const auto every = std::numeric_limits<std::int64_t>::max();
  const Schedule schedule{std::numeric_limits<double>::infinity(), member.end - member.start.time, every};
  EXPECT_TRUE(simulate(*integrator, member.start, schedule, [](const Motion&) {}).outcome);
  return integrator->state();
}

class SystemLanesTest : public testing::TestWithParam<bool> {};

// Largest differences seen: 3e-10 free, 3e-10 loaded.
TEST_P(SystemLanesTest, MembersEndWhereTheChainSolverSays) {
  const ChainSystems systems(19, GetParam(), 1.5);
  const std::vector<LaneEnd> ends = ends_of(systems.members, {.tolerance = 1e-12});
  for (std::size_t k = 0; k < ends.size(); ++k) {
    ASSERT_EQ(ends[k].status, Status::ok) << k;
    EXPECT_EQ(ends[k].motion.time, 1.5);
    EXPECT_LT(distance(ends[k].motion, alone(systems.chains[k], systems.members[k])), 3e-9) << k;
  }
}

// Neither others, nor one that is so far from zero that its sines come from elsewhere.
TEST_P(SystemLanesTest, AMemberDependsOnItselfAlone) {
  ChainSystems systems(23, GetParam(), 1);
  systems.members[4].start.q[0] += 2e6 * std::numbers::pi;
  const LaneOptions options{.tolerance = 1e-8, .energy_every = 3};
  const std::vector<LaneEnd> together = ends_of(systems.members, options);
  for (std::size_t k = 0; k < together.size(); ++k) {
    const LaneEnd one = ends_of({systems.members[k]}, options)[0];
    EXPECT_EQ(one.motion.q, together[k].motion.q) << k;
    EXPECT_EQ(one.motion.v, together[k].motion.v) << k;
    EXPECT_EQ(one.steps, together[k].steps) << k;
    EXPECT_EQ(one.energy_error, together[k].energy_error) << k;
    EXPECT_EQ(one.energy_sum, together[k].energy_sum) << k;
    if (!GetParam()) {
      EXPECT_LT(one.energy_error / one.energy_sum, 3e-8);  // seen: 3e-9
    }
  }
}

// Registers of two numbers, as of all: to the last bit.
TEST_P(SystemLanesTest, WidthsAgree) {
  const ChainSystems systems(13, GetParam(), 1);
  const LaneOptions options{.tolerance = 1e-8, .energy_every = 1};
  const std::vector<LaneEnd> wide = ends_of(systems.members, options);
  const std::vector<LaneEnd> narrow = ends_of<RegisterFor<2>>(systems.members, options);
  for (std::size_t k = 0; k < wide.size(); ++k) {
    EXPECT_EQ(wide[k].motion.q, narrow[k].motion.q) << k;
    EXPECT_EQ(wide[k].motion.v, narrow[k].motion.v) << k;
    EXPECT_EQ(wide[k].energy_error, narrow[k].energy_error) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Loads, SystemLanesTest, testing::Bool(),
                         [](const auto& each) { return each.param ? "loaded" : "free"; });

TEST(SystemLanes, AMemberThatIsNoNumberStopsNobodyElse) {
  ChainSystems systems(11, false, 1);
  const std::vector<LaneEnd> expected = ends_of(systems.members, {.tolerance = 1e-8});
  systems.members[2].start.v[1] = std::numeric_limits<double>::quiet_NaN();
  systems.members[6].start.q[0] = std::numeric_limits<double>::infinity();
  const std::vector<LaneEnd> found = ends_of(systems.members, {.tolerance = 1e-8});
  for (std::size_t k = 0; k < found.size(); ++k) {
    EXPECT_EQ(found[k].status == Status::ok, k != 2 && k != 6) << k;
    if (found[k].status == Status::ok) {
      EXPECT_EQ(found[k].motion.q, expected[k].motion.q) << k;
    }
  }
}

// A kernel compiled for other registers than the library.
TEST(SystemLanes, ACompiledLibraryMovesItsOwnLanesOnly) {
  const ChainSystems systems(3, false, 1);
  class Watch : public LaneWatch {
    bool wants_steps() const override { return false; }
    void after_step(LaneSteps& /*steps*/) override {}
    bool stops() override { return false; }
  } watch;
  RunOptions options;
  options.method = Method::dopri5;
  options.tolerance = 1e-8;
  MoveSystemMembers* const move = library().system_lanes(options);
  ASSERT_NE(move, nullptr);
  std::vector<PlainSystemMember> members;
  for (const LaneSystemMember& from : systems.members) {
    members.push_back({from.system, from.start.time, from.end, from.start.q.data(), from.start.v.data()});
  }
  Eigen::Matrix2Xd q(2, 3), v(2, 3);
  const auto ends_by = [&](LaneDynamics& kernel) {
    std::vector<PlainMemberEnd> ends;
    for (Eigen::Index k = 0; k < 3; ++k) ends.push_back({&q(0, k), &v(0, k), 0, {}, 0, 0, 0, 0});
    EXPECT_TRUE(move(kernel, options, 0, members, ends, watch));
    return ends;
  };
  class Other : public LaneKernel<Kernel> {
    int lanes() const override { return 3; }
  } other;
  const std::vector<PlainMemberEnd> left = ends_by(other);
  for (std::size_t k = 0; k < left.size(); ++k) {
    EXPECT_EQ(left[k].status, Status::not_converged);
    EXPECT_EQ(left[k].time, 0.25);
    EXPECT_EQ(Eigen::Map<const Eigen::Vector2d>(left[k].q), systems.members[k].start.q);
  }
}

// Accelerations are those without tangents, their derivatives those of dual numbers.
TEST(SystemLanes, AccelerationsHaveTheirDerivatives) {
  using Slopes = Dual<1>;
  const ChainSystems systems(MemberRegister::size, true, 1);
  constexpr auto lanes = static_cast<std::size_t>(MemberRegister::size);
  LaneKernel<Kernel> kernel;
  struct Numbers {
    alignas(pack_alignment) double of[2 * lanes] = {};
  } q, v, dq, dv, a, expected, da;
  alignas(pack_alignment) double times[lanes];
  for (std::size_t k = 0; k < lanes; ++k) {
    kernel.take(static_cast<int>(k), systems.members[k].system);
    times[k] = 0.1 * static_cast<double>(k);
    for (std::size_t i = 0; i < 2; ++i) {
      const std::size_t at = i * lanes + k;
      q.of[at] = systems.members[k].start.q[static_cast<Eigen::Index>(i)];
      v.of[at] = systems.members[k].start.v[static_cast<Eigen::Index>(i)];
      dq.of[at] = 0.3 + static_cast<double>(at);
      dv.of[at] = 1.7 - static_cast<double>(k);
    }
  }
  kernel.accelerations(times, q.of, v.of, expected.of);
  kernel.variations(times, q.of, v.of, dq.of, dv.of, a.of, da.of);
  for (std::size_t k = 0; k < lanes; ++k) {
    const Chain<Planar>& chain = systems.chains[k];
    Kernel::Parameters<Slopes> parameters;
    Kernel::Vector<Slopes> angles, rates, found;
    Kernel::Inputs<Slopes> torque;
    Torque<Planar, Eigen::Dynamic> acting;
    chain.torque(times[k], acting);
    parameters.gravity = Slopes(chain.gravity());
    for (Eigen::Index i = 0; i < 2; ++i) {
      const std::size_t at = static_cast<std::size_t>(i) * lanes + k;
      parameters.masses[i] = Slopes(chain.masses()[i]);
      parameters.lengths[i] = Slopes(chain.lengths()[i]);
      parameters.damping[i] = Slopes(chain.damping()[i]);
      angles[i] = Slopes(q.of[at]);
      angles[i].slopes[0] = dq.of[at];
      rates[i] = Slopes(v.of[at]);
      rates[i].slopes[0] = dv.of[at];
      torque(0, i) = Slopes(acting(0, i));
    }
    Kernel::acceleration(parameters, angles, rates, torque, found);
    for (std::size_t i = 0; i < 2; ++i) {
      const std::size_t at = i * lanes + k;
      EXPECT_EQ(a.of[at], expected.of[at]);
      const double slope = found[static_cast<Eigen::Index>(i)].slopes[0];
      EXPECT_NEAR(da.of[at], slope, 1e-13 * (1 + std::abs(slope)));  // seen: 3e-15
    }
  }
}

TEST(LaneFunctions, HaveTheirDerivatives) {
  using L = LaneDual<LanePack<MemberRegister>>;
  for (const double number : {0.3, -0.7, 0.99}) {
    const auto expect = [&](auto function, double at) {
      L x(at);
      x.slope = LanePack<MemberRegister>(-1.5);
      Dual<1> same(at);
      same.slopes[0] = -1.5;
      const double slope = function(same).slopes[0];
      EXPECT_NEAR(function(x).slope[0], slope, 4e-15 * (1 + std::abs(slope))) << at;  // seen: 3e-16
      EXPECT_NEAR(function(x).value[0], function(same).value, 4e-16 * std::abs(function(same).value)) << at;
    };
    expect([](const auto& x) { return sin(x); }, number);
    expect([](const auto& x) { return cos(x); }, number);
    expect([](const auto& x) { return tan(x); }, number);
    expect([](const auto& x) { return asin(x); }, number);
    expect([](const auto& x) { return acos(x); }, number);
    expect([](const auto& x) { return atan(x); }, number);
    expect([](const auto& x) { return sinh(x); }, number);
    expect([](const auto& x) { return cosh(x); }, number);
    expect([](const auto& x) { return tanh(x); }, number);
    expect([](const auto& x) { return exp(x); }, number);
    expect([](const auto& x) { return cbrt(x); }, number);
    expect([](const auto& x) { return x / (x * x - x); }, number);
    expect([](const auto& x) { return log(x); }, std::abs(number));
    expect([](const auto& x) { return sqrt(x); }, std::abs(number));
    expect([](const auto& x) { return pow(x, std::decay_t<decltype(x)>(-1.5)); }, std::abs(number));
  }
}

TEST(LaneFunctions, AreThoseOfTheStandardLibrary) {
  using L = LanePack<MemberRegister>;
  for (const double x : {0.3, -0.7, 0.99}) {
    const L pack(x);
    EXPECT_EQ(tan(pack)[0], std::tan(x));
    EXPECT_EQ(asin(pack)[0], std::asin(x));
    EXPECT_EQ(acos(pack)[0], std::acos(x));
    EXPECT_EQ(atan(pack)[0], std::atan(x));
    EXPECT_EQ(sinh(pack)[0], std::sinh(x));
    EXPECT_EQ(cosh(pack)[0], std::cosh(x));
    EXPECT_EQ(tanh(pack)[0], std::tanh(x));
    EXPECT_EQ(cbrt(pack)[0], std::cbrt(x));
    EXPECT_EQ(pow(abs(pack), L(-1.5))[0], std::pow(std::abs(x), -1.5));
    EXPECT_NEAR(sin(pack)[0], std::sin(x), 2e-16);
    EXPECT_NEAR(cos(pack)[0], std::cos(x), 2e-16);
  }
  EXPECT_EQ(sin(L(1e7))[0], std::sin(1e7));
  EXPECT_EQ(cos(L(1e7))[0], std::cos(1e7));
}

}  // namespace
}  // namespace pendula::test
