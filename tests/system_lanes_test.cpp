// Systems of a generated kernel, one in each lane: each as if it were alone.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <numbers>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/numeric/dual_functions.hpp>
#include <pendula/numeric/functions.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/system/kernel_table.hpp>
#include <type_traits>
#include <vector>

#include "support/chain_systems.hpp"

namespace pendula::test {
namespace {

using Kernel = kernels::Planar2;

template <class Register = MemberRegister>
std::vector<ReachedEnd> ends_of(const std::vector<SystemMember>& members, const QueueOptions& options) {
  MemberSystems<LanePack<Register>> dynamics(system_table<Kernel>);
  SystemLanes<DormandPrince5, Register> queue(dynamics, options);
  return ends_by(queue, dynamics.coordinates(), plain_members(members));
}

double distance(const Motion& a, const Motion& b) {
  return std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff());
}

Motion alone(const Chain<Planar>& chain, const SystemMember& member) {
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
  const std::vector<ReachedEnd> ends = ends_of(systems.members, {.tolerance = 1e-12});
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
  const QueueOptions options{.tolerance = 1e-8, .energy_every = 3};
  const std::vector<ReachedEnd> together = ends_of(systems.members, options);
  for (std::size_t k = 0; k < together.size(); ++k) {
    const ReachedEnd one = ends_of({systems.members[k]}, options)[0];
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
  const QueueOptions options{.tolerance = 1e-8, .energy_every = 1};
  const std::vector<ReachedEnd> wide = ends_of(systems.members, options);
  const std::vector<ReachedEnd> narrow = ends_of<RegisterFor<2>>(systems.members, options);
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
  const std::vector<ReachedEnd> expected = ends_of(systems.members, {.tolerance = 1e-8});
  systems.members[2].start.v[1] = std::numeric_limits<double>::quiet_NaN();
  systems.members[6].start.q[0] = std::numeric_limits<double>::infinity();
  const std::vector<ReachedEnd> found = ends_of(systems.members, {.tolerance = 1e-8});
  for (std::size_t k = 0; k < found.size(); ++k) {
    EXPECT_EQ(found[k].status == Status::ok, k != 2 && k != 6) << k;
    if (found[k].status == Status::ok) {
      EXPECT_EQ(found[k].motion.q, expected[k].motion.q) << k;
    }
  }
}

// Accelerations are those without tangents, their derivatives those of the equations of motion.
TEST(SystemLanes, AccelerationsHaveTheirDerivatives) {
  const ChainSystems systems(MemberRegister::size, true, 1);
  constexpr auto lanes = static_cast<std::size_t>(MemberRegister::size);
  MemberSystems<LanePack<MemberRegister>> dynamics(system_table<Kernel>);
  PackRows<lanes> q(2), v(2), dq(2), dv(2), a(2), expected(2), da(2), times(1);
  for (std::size_t k = 0; k < lanes; ++k) {
    dynamics.take(static_cast<int>(k), systems.members[k].system);
    times[0][k] = 0.1 * static_cast<double>(k);
    for (std::size_t i = 0; i < 2; ++i) {
      q[i][k] = systems.members[k].start.q[static_cast<Eigen::Index>(i)];
      v[i][k] = systems.members[k].start.v[static_cast<Eigen::Index>(i)];
      dq[i][k] = 0.3 + static_cast<double>(i * lanes + k);
      dv[i][k] = 1.7 - static_cast<double>(k);
    }
  }
  dynamics.call(times[0], &SystemFunctions::acceleration, q[0], v[0], expected[0]);
  dynamics.call(times[0], &SystemFunctions::acceleration_along, q[0], v[0], dq[0], dv[0], a[0], da[0]);
  for (std::size_t k = 0; k < lanes; ++k) {
    const auto member = [k](const PackRows<lanes>& rows) { return Eigen::Vector2d(rows[0][k], rows[1][k]); };
    SystemAt<1> here(SystemModel(system_table<Kernel>, systems.members[k].system));
    here.set_time(times[0][k]);
    const Eigen::Vector2d angles = member(q), rates = member(v), accelerations = member(a);
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 2, Eigen::RowMajor> by_q, by_v, by_a;
    here(&SystemFunctions::residual_with_jacobians, angles.data(), rates.data(), accelerations.data(), residual.data(),
         by_q.data(), by_v.data(), by_a.data());
    const Eigen::Vector2d slopes = -by_a.inverse() * (by_q * member(dq) + by_v * member(dv));
    EXPECT_EQ(accelerations, member(expected));
    for (std::size_t i = 0; i < 2; ++i) {
      const double slope = slopes[static_cast<Eigen::Index>(i)];
      EXPECT_NEAR(da[i][k], slope, 1e-13 * (1 + std::abs(slope)));  // seen: 4e-15
    }
  }
}

using Lanes = Pack<MemberRegister::size, MemberRegister>;

double first(double x) {
  return x;
}
double first(const Lanes& x) {
  alignas(pack_alignment) double numbers[MemberRegister::size];
  x.store(numbers);
  return numbers[0];
}

TEST(LaneFunctions, HaveTheirDerivatives) {
  for (const double x : {0.3, -0.7, 0.99}) {
    const double size = std::abs(x);
    const auto expect_of = [](const auto& found, double value, double slope) {
      EXPECT_NEAR(first(found.value), value, 4e-16 * std::abs(value));
      EXPECT_NEAR(first(found.slope), -1.5 * slope, 4e-15 * (1 + std::abs(1.5 * slope)));  // seen: 3e-16
    };
    const auto expect = [&](auto function, double at, double value, double slope) {
      expect_of(function(Dual<double>(at, -1.5)), value, slope);
      expect_of(function(Dual<Lanes>(Lanes(at), Lanes(-1.5))), value, slope);
    };
    expect([](const auto& y) { return sin(y); }, x, std::sin(x), std::cos(x));
    expect([](const auto& y) { return cos(y); }, x, std::cos(x), -std::sin(x));
    expect([](const auto& y) { return tan(y); }, x, std::tan(x), 1 / (std::cos(x) * std::cos(x)));
    expect([](const auto& y) { return asin(y); }, x, std::asin(x), 1 / std::sqrt((1 - x) * (1 + x)));
    expect([](const auto& y) { return acos(y); }, x, std::acos(x), -1 / std::sqrt((1 - x) * (1 + x)));
    expect([](const auto& y) { return atan(y); }, x, std::atan(x), 1 / (1 + x * x));
    expect([](const auto& y) { return sinh(y); }, x, std::sinh(x), std::cosh(x));
    expect([](const auto& y) { return cosh(y); }, x, std::cosh(x), std::sinh(x));
    expect([](const auto& y) { return tanh(y); }, x, std::tanh(x), 1 / (std::cosh(x) * std::cosh(x)));
    expect([](const auto& y) { return exp(y); }, x, std::exp(x), std::exp(x));
    expect([](const auto& y) { return cbrt(y); }, x, std::cbrt(x), std::cbrt(x) / (3 * x));
    const double d = x * x - x + std::exp(x), d_slope = 2 * x - 1 + std::exp(x);
    expect([](const auto& y) { return y / (y * y - y + exp(y)); }, x, x / d, (d - x * d_slope) / (d * d));
    expect([](const auto& y) { return log(y); }, size, std::log(size), 1 / size);
    expect([](const auto& y) { return sqrt(y); }, size, std::sqrt(size), 0.5 / std::sqrt(size));
    expect([](const auto& y) { return pow(y, std::decay_t<decltype(y)>(-1.5)); }, size, std::pow(size, -1.5),
           -1.5 * std::pow(size, -2.5));
  }
}

// Whatever their neighbours are.
TEST(LaneFunctions, AreThoseOfTheStandardLibrary) {
  for (const double x : {0.3, -0.7, 0.99}) {
    alignas(pack_alignment) double numbers[MemberRegister::size];
    std::fill(std::begin(numbers), std::end(numbers), 1e7);
    numbers[0] = x;
    const Lanes pack = Lanes::load(numbers);
    EXPECT_EQ(first(tan(pack)), std::tan(x));
    EXPECT_EQ(first(asin(pack)), std::asin(x));
    EXPECT_EQ(first(acos(pack)), std::acos(x));
    EXPECT_EQ(first(atan(pack)), std::atan(x));
    EXPECT_EQ(first(sinh(pack)), std::sinh(x));
    EXPECT_EQ(first(cosh(pack)), std::cosh(x));
    EXPECT_EQ(first(tanh(pack)), std::tanh(x));
    EXPECT_EQ(first(cbrt(pack)), std::cbrt(x));
    EXPECT_EQ(first(pow(abs(pack), Lanes(-1.5))), std::pow(std::abs(x), -1.5));
    EXPECT_EQ(first(exp(pack)), first(exp(Lanes(x))));
    EXPECT_EQ(first(log(abs(pack))), first(log(Lanes(std::abs(x)))));
    EXPECT_EQ(first(sin(pack)), first(sin(Lanes(x))));
    EXPECT_EQ(first(cos(pack)), first(cos(Lanes(x))));
    EXPECT_NEAR(first(sin(pack)), std::sin(x), 2e-16);
    EXPECT_NEAR(first(cos(pack)), std::cos(x), 2e-16);
  }
  EXPECT_EQ(first(sin(Lanes(1e7))), std::sin(1e7));
  EXPECT_EQ(first(cos(Lanes(1e7))), std::cos(1e7));
}

}  // namespace
}  // namespace pendula::test
