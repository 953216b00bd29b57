#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <pendula/chain/invariants.hpp>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/run/integrator.hpp>
#include <random>
#include <type_traits>
#include <vector>

#include "support/growths.hpp"
#include "support/looks.hpp"
#include "support/members.hpp"

namespace pendula {
namespace {

using test::ChainMember, test::ReachedEnd, test::ends_by, test::plain_members;

template <class Space, int N = Eigen::Dynamic>
Chain<Space, N> drawn_chain(std::mt19937& random, int links) {
  std::uniform_real_distribution<double> size(0.5, 2);
  ChainParameters<Space, N> parameters;
  parameters.masses.resize(links);
  parameters.lengths.resize(links);
  for (int i = 0; i < links; ++i) {
    parameters.masses[i] = size(random);
    parameters.lengths[i] = size(random);
  }
  parameters.damping.setZero(links);
  parameters.torque.setZero(Space::torque_components, links);
  return Chain<Space, N>(parameters);
}

template <class Space, int N>
Chain<Space> of_any_size(const Chain<Space, N>& chain) {
  ChainParameters<Space> parameters;
  parameters.masses = chain.masses();
  parameters.lengths = chain.lengths();
  parameters.gravity = chain.gravity();
  return Chain<Space>(parameters);
}

template <class Space, int N>
std::vector<ChainMember<Space, N>> drawn_members(std::mt19937& random, int links, std::size_t count, double end) {
  std::uniform_real_distribution<double> angle(-3, 3), rate(-2, 2);
  std::vector<ChainMember<Space, N>> members(count);
  for (auto& member : members) {
    member.start = Motion(0, Eigen::VectorXd(Space::dof * links), Eigen::VectorXd(Space::dof * links));
    for (double& q : member.start.q) q = angle(random);
    for (double& v : member.start.v) v = rate(random);
    member.end = end;
  }
  return members;
}

template <class Queue, class Space, int N>
std::vector<ReachedEnd> ends_of(const Chain<Space, N>& chain, const std::vector<ChainMember<Space, N>>& members,
                                const QueueOptions& options) {
  Queue queue(chain.links(), options);
  return ends_by(queue, Space::dof * chain.links(), plain_members(chain, members));
}

template <class Space>
Motion scalar_end(const Chain<Space>& chain, const Motion& start, double end, const RunOptions& options) {
  const auto integrator = make_integrator(chain, options);
  integrator->start(start);
  while (end - integrator->time() > 1e-13 * end) {
    const double left = end - integrator->time();
    const Outcome outcome = integrator->step(options.step == 0 ? left : std::min(options.step, left));
    EXPECT_TRUE(outcome) << outcome;
    if (!outcome) break;
  }
  return integrator->state();
}

bool same_bits(const ReachedEnd& a, const ReachedEnd& b) {
  const auto bytes = sizeof(double) * static_cast<std::size_t>(a.motion.q.size());
  return a.status == b.status && a.steps == b.steps && a.motion.q.size() == b.motion.q.size() &&
         std::memcmp(a.motion.q.data(), b.motion.q.data(), bytes) == 0 &&
         std::memcmp(a.motion.v.data(), b.motion.v.data(), bytes) == 0;
}

double distance(const Motion& a, const Motion& b) {
  return std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff());
}

template <class SpaceType, int S, int N, int Links>
struct Case {
  using Space = SpaceType;
  static constexpr int stages = S, known = N, links = Links;
  using Queue = GaussLanes<Space, S, N>;
};

template <class C>
class EnsembleLanes : public testing::Test {};

constexpr int any = Eigen::Dynamic;
using Cases =
    testing::Types<Case<Planar, 1, any, 2>, Case<Planar, 4, 2, 2>, Case<Planar, 5, 3, 3>, Case<Planar, 8, any, 4>,
                   Case<Spatial, 2, 2, 2>, Case<Spatial, 3, any, 3>, Case<Spatial, 8, any, 1>>;
TYPED_TEST_SUITE(EnsembleLanes, Cases);

// Largest difference to the scalar chain solver after half a second, which makes of rounding what it does.
TYPED_TEST(EnsembleLanes, ConstantStepsEndWhereScalarOnesDo) {
  using Space = typename TypeParam::Space;
  std::mt19937 random(1);
  const auto chain = drawn_chain<Space, TypeParam::known>(random, TypeParam::links);
  const auto members = drawn_members<Space, TypeParam::known>(random, TypeParam::links, 21, 0.5);
  const double h = TypeParam::stages <= 2 ? 1e-3 : 1e-2;
  const auto ends = ends_of<typename TypeParam::Queue>(chain, members, {.step = h});
  const RunOptions options{
      .stages = TypeParam::stages, .solver = Solver::chain, .iteration = Iteration::fixed_point, .step = h};
  for (std::size_t k = 0; k < members.size(); ++k) {
    ASSERT_EQ(ends[k].status, Status::ok);
    EXPECT_EQ(ends[k].motion.time, 0.5);
    EXPECT_EQ(ends[k].steps, std::lround(0.5 / h));
    const Motion scalar = scalar_end(of_any_size(chain), members[k].start, 0.5, options);
    EXPECT_LT(distance(ends[k].motion, scalar), 1e-11) << "member " << k;
  }
}

TYPED_TEST(EnsembleLanes, ChosenStepsAreThoseOfTheScalarController) {
  if (TypeParam::stages < 3) return;
  using Space = typename TypeParam::Space;
  std::mt19937 random(2);
  const auto chain = drawn_chain<Space, TypeParam::known>(random, TypeParam::links);
  const auto members = drawn_members<Space, TypeParam::known>(random, TypeParam::links, 13, 1);
  const auto ends = ends_of<typename TypeParam::Queue>(chain, members, {.tolerance = 1e-8, .enough = 1e-18});
  const RunOptions options{.stages = TypeParam::stages,
                           .solver = Solver::chain,
                           .iteration = Iteration::fixed_point,
                           .step = 0,
                           .tolerance = 1e-8};
  for (std::size_t k = 0; k < members.size(); ++k) {
    ASSERT_EQ(ends[k].status, Status::ok);
    const auto integrator = make_integrator(of_any_size(chain), options);
    integrator->start(members[k].start);
    while (1 - integrator->time() > 1e-13) ASSERT_TRUE(integrator->step(1 - integrator->time()));
    EXPECT_NEAR(static_cast<double>(ends[k].steps), static_cast<double>(integrator->statistics().steps), 3);
    EXPECT_LT(distance(ends[k].motion, integrator->state()), 1e-5) << "member " << k;
  }
}

// A member alone, among others, elsewhere in the queue, beside one that fails: the same bits.
TYPED_TEST(EnsembleLanes, AMemberDependsOnItselfAlone) {
  using Space = typename TypeParam::Space;
  using Member = ChainMember<Space, TypeParam::known>;
  using Queue = typename TypeParam::Queue;
  std::mt19937 random(3);
  const auto chain = drawn_chain<Space, TypeParam::known>(random, TypeParam::links);
  std::vector<Member> members = drawn_members<Space, TypeParam::known>(random, TypeParam::links, 29, 0.3);
  for (std::size_t k = 0; k < members.size(); ++k) members[k].end = 0.05 * static_cast<double>(1 + k % 7);
  for (const double step : {0.0, 2e-3}) {
    const QueueOptions options{.step = step, .tolerance = 1e-7};
    const auto ends = ends_of<Queue>(chain, members, options);
    std::vector<std::size_t> order(members.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random);
    std::vector<Member> shuffled;
    for (const std::size_t k : order) {
      shuffled.push_back(members[k]);
      if (k % 5 != 0) continue;
      shuffled.push_back(members[k]);
      shuffled.back().start.v.setConstant(k % 2 == 0 ? 1e200 : std::numeric_limits<double>::quiet_NaN());
    }
    const auto others = ends_of<Queue>(chain, shuffled, options);
    for (std::size_t k = 0, at = 0; k < order.size(); ++k, ++at) {
      EXPECT_TRUE(same_bits(others[at], ends[order[k]])) << "member " << order[k] << ", step " << step;
      if (order[k] % 5 != 0) continue;
      EXPECT_NE(others[++at].status, Status::ok);
    }
    const auto alone = ends_of<Queue>(chain, std::vector<Member>{members[4]}, options);
    EXPECT_TRUE(same_bits(alone[0], ends[4]));
  }
}

// Turned round where they end, members come back.
TYPED_TEST(EnsembleLanes, AReversedMemberReturns) {
  using Space = typename TypeParam::Space;
  std::mt19937 random(4);
  const auto chain = drawn_chain<Space, TypeParam::known>(random, TypeParam::links);
  auto members = drawn_members<Space, TypeParam::known>(random, TypeParam::links, 9, 0.5);
  const QueueOptions options{.step = 0.5 / 256};
  const auto ends = ends_of<typename TypeParam::Queue>(chain, members, options);
  auto back = members;
  for (std::size_t k = 0; k < back.size(); ++k) back[k].start = Motion(0, ends[k].motion.q, -ends[k].motion.v);
  const auto returned = ends_of<typename TypeParam::Queue>(chain, back, options);
  for (std::size_t k = 0; k < back.size(); ++k) {
    const Motion there(0, returned[k].motion.q, -returned[k].motion.v);
    EXPECT_LT(distance(there, members[k].start), 1e-10) << "member " << k;
  }
}

TEST(EnsembleLanesTest, EveryMemberMayHaveAChainOfItsOwn) {
  std::mt19937 random(5);
  auto members = drawn_members<Planar, 2>(random, 2, 11, 0.5);
  std::vector<Chain<Planar, 2>> chains;
  chains.reserve(members.size());
  for (std::size_t k = 0; k < members.size(); ++k) chains.push_back(drawn_chain<Planar, 2>(random, 2));
  for (std::size_t k = 0; k < members.size(); ++k) members[k].chain = &chains[k];
  const auto ends = ends_of<GaussLanes<Planar, 8, 2>>(chains[0], members, {.step = 1e-2});
  const RunOptions options{.stages = 8, .solver = Solver::chain, .iteration = Iteration::fixed_point, .step = 1e-2};
  for (std::size_t k = 0; k < members.size(); ++k) {
    const Motion scalar = scalar_end(of_any_size(chains[k]), members[k].start, 0.5, options);
    EXPECT_LT(distance(ends[k].motion, scalar), 1e-11);  // measured 2e-14
  }
}

// Turns are counted: a rod with twenty radians a second goes round.
TEST(EnsembleLanesTest, AnglesAreContinued) {
  std::mt19937 random(6);
  const auto chain = drawn_chain<Planar, 2>(random, 2);
  auto members = drawn_members<Planar, 2>(random, 2, 8, 2);
  for (auto& member : members) {
    member.start.q.array() += 40;
    member.start.v.setConstant(&member - members.data() < 4 ? 15 : -15);
  }
  const auto ends = ends_of<GaussLanes<Planar, 8, 2>>(chain, members, {.step = 1.0 / 128});
  const RunOptions options{
      .stages = 8, .solver = Solver::chain, .iteration = Iteration::fixed_point, .step = 1.0 / 128};
  for (std::size_t k = 0; k < members.size(); ++k) {
    const Motion scalar = scalar_end(of_any_size(chain), members[k].start, 2, options);
    EXPECT_LT(distance(ends[k].motion, scalar), 1e-7);
    EXPECT_GT(std::abs(ends[k].motion.q[0] - members[k].start.q[0]), 6);
  }
}

template <class Queue>
double error_at(double h, const Chain<Planar, 2>& chain, const std::vector<ChainMember<Planar, 2>>& members,
                const std::vector<ReachedEnd>& reference) {
  const auto ends = ends_of<Queue>(chain, members, {.step = h});
  double error = 0;
  for (std::size_t k = 0; k < ends.size(); ++k) {
    error = std::max(error, distance(ends[k].motion, reference[k].motion));
  }
  return error;
}

TEST(EnsembleLanesTest, ErrorsShrinkWithTheOrder) {
  std::mt19937 random(7);
  const auto chain = drawn_chain<Planar, 2>(random, 2);
  const auto members = drawn_members<Planar, 2>(random, 2, 8, 0.5);
  const auto reference = ends_of<GaussLanes<Planar, 8, 2>>(chain, members, {.step = 1.0 / 256});
  const auto order = [&](double coarse, double fine) { return std::log2(coarse / fine); };
  EXPECT_NEAR(order(error_at<GaussLanes<Planar, 1, 2>>(1.0 / 256, chain, members, reference),
                    error_at<GaussLanes<Planar, 1, 2>>(1.0 / 512, chain, members, reference)),
              2, 0.2);
  EXPECT_NEAR(order(error_at<GaussLanes<Planar, 2, 2>>(1.0 / 128, chain, members, reference),
                    error_at<GaussLanes<Planar, 2, 2>>(1.0 / 256, chain, members, reference)),
              4, 0.3);
  EXPECT_NEAR(order(error_at<GaussLanes<Planar, 4, 2>>(1.0 / 64, chain, members, reference),
                    error_at<GaussLanes<Planar, 4, 2>>(1.0 / 128, chain, members, reference)),
              8, 0.8);
  EXPECT_NEAR(order(error_at<ExplicitLanes<Planar, DormandPrince5, 2>>(1.0 / 128, chain, members, reference),
                    error_at<ExplicitLanes<Planar, DormandPrince5, 2>>(1.0 / 256, chain, members, reference)),
              5, 0.3);
  EXPECT_NEAR(order(error_at<ExplicitLanes<Planar, Fehlberg8, 2>>(1.0 / 32, chain, members, reference),
                    error_at<ExplicitLanes<Planar, Fehlberg8, 2>>(1.0 / 64, chain, members, reference)),
              8, 0.8);  // measured 7.5
  EXPECT_NEAR(order(error_at<ExplicitLanes<Planar, ClassicalRungeKutta, 2>>(1.0 / 512, chain, members, reference),
                    error_at<ExplicitLanes<Planar, ClassicalRungeKutta, 2>>(1.0 / 1024, chain, members, reference)),
              4, 0.3);
}

// Of rounding alone: eight stages, 2·10⁴ steps.
TEST(EnsembleLanesTest, EnergyStaysToTheLastDigits) {
  std::mt19937 random(8);
  const auto chain = drawn_chain<Planar, 2>(random, 2);
  const auto members = drawn_members<Planar, 2>(random, 2, 8, 100);
  const auto ends = ends_of<GaussLanes<Planar, 8, 2>>(chain, members, {.step = 1.0 / 200, .energy_every = 1});
  for (const ReachedEnd& end : ends) EXPECT_LT(end.energy_error / energy_scale(chain), 4e-15);  // measured 1e-15
}

// By few stages, stages are predicted from the steps that there were: from a cold start on, each more of them helps.
TEST(EnsembleLanesTest, EveryStepOfOneSizeHelpsThePrediction) {
  using Stepper = MembersStepper<ChainMembers<Planar, 2>>;
  using L = Stepper::L;
  std::mt19937 random(2);
  const Chain<Planar> chain = drawn_chain<Planar>(random, 3);
  const ChainLinks<Planar> links(chain);
  Stepper stepper(3);
  for (int lane = 0; lane < L::size; ++lane) {
    const Eigen::Vector3d q(0.5, 0.2 + 0.1 * lane, -0.3), v(0.1, -0.2, 0.3);
    stepper.start(lane, 0, chain, links, q.data(), v.data());
  }
  const double h = 0.002;
  std::vector<std::int64_t> iterations;
  for (int step = 0; step < 12; ++step) {
    const std::int64_t before = stepper.iterations();
    const auto found = stepper.solve(L(step * h), L(h), L(0.0) <= L(0.0));
    ASSERT_TRUE(xsimd::all(found));
    stepper.accept(found);
    iterations.push_back(stepper.iterations() - before);
  }
  for (std::size_t step = 2; step < iterations.size(); ++step) EXPECT_LE(iterations[step], iterations[1]) << step;
  EXPECT_LE(iterations.back(), iterations[1] - 2);  // measured 4 and 2
}

// Within a step: as accurate as its end where members look, which steps do not see; glances have the polynomial's
// errors.
TEST(EnsembleLanesTest, LooksHaveTheFullOrder) {
  std::mt19937 random(14);
  const auto chain = drawn_chain<Spatial, 2>(random, 2);
  const auto members = drawn_members<Spatial, 2>(random, 2, 11, 0.5);
  const QueueOptions options{.step = 0.02};
  const auto expected = ends_of<GaussLanes<Spatial, 4, 2>>(chain, members, options);
  GaussLanes<Spatial, 4, 2> queue(2, options);
  test::Looks looks(members.size(), 4, 0.3);
  queue.set_watch(looks);
  const auto ends = ends_by(queue, 4, plain_members(chain, members));
  EXPECT_EQ(looks.failed, 0);
  double look = 0, glance = 0;
  for (std::size_t k = 0; k < members.size(); ++k) {
    EXPECT_TRUE(same_bits(ends[k], expected[k])) << k;
    const Motion& looked = looks.looked[k];
    const Motion exact = scalar_end(of_any_size(chain), members[k].start, looked.time,
                                    {.stages = 8, .solver = Solver::chain, .step = 0.01});
    look = std::max(look, distance(looked, exact));
    glance = std::max(glance, distance(looks.glanced[k], exact));
  }
  EXPECT_LT(look, 1e-7);    // measured 1.8e-8
  EXPECT_GT(glance, 5e-6);  // measured 1.2e-5
}

// Steps so large that a fixed point does not contract: reported, and left where they were.
TEST(EnsembleLanesTest, AMemberThatFailsSaysSo) {
  std::mt19937 random(9);
  const auto chain = drawn_chain<Planar, 2>(random, 2);
  auto members = drawn_members<Planar, 2>(random, 2, 12, 1);
  members[3].start.v << 300, -200;
  const auto ends = ends_of<GaussLanes<Planar, 4, 2>>(chain, members, {.step = 0.02});
  for (std::size_t k = 0; k < members.size(); ++k) EXPECT_EQ(ends[k].status == Status::ok, k != 3) << k;
  EXPECT_EQ(ends[3].steps, 0);
  EXPECT_EQ(ends[3].motion.time, 0);
  EXPECT_LT(distance(ends[3].motion, members[3].start), 1e-12);
}

// Registers of every width give the same bits.
TEST(EnsembleLanesTest, WidthsAgree) {
  std::mt19937 random(10);
  const auto chain = drawn_chain<Planar, 2>(random, 2);
  const auto members = drawn_members<Planar, 2>(random, 2, 11, 0.5);
  const auto wide = ends_of<GaussLanes<Planar, 4, 2>>(chain, members, {.step = 4e-3});
  const auto narrow = ends_of<GaussLanes<Planar, 4, 2, RegisterFor<2>>>(chain, members, {.step = 4e-3});
  for (std::size_t k = 0; k < members.size(); ++k) EXPECT_TRUE(same_bits(wide[k], narrow[k])) << k;
}

template <class Space>
using WithTangent = ChainAccelerations<Space, 3, LanePack<MemberRegister>, true>;

// Rods of members that have started, moved along their tangents.
template <class Space>
auto moved_rods(const typename WithTangent<Space>::Parts& rods, double by) {
  using L = typename WithTangent<Space>::L;
  typename ChainAccelerations<Space, 3>::Parts moved(3);
  for (int i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < WithTangent<Space>::D; ++k) {
      moved[i].place[k] = rods[i].place[k].value + L(by) * rods[i].place[k].slope;
      moved[i].rate[k] = rods[i].rate[k].value + L(by) * rods[i].rate[k].slope;
    }
  }
  return moved;
}

template <class Space>
void expect_derivatives() {
  std::mt19937 random(12);
  const auto chain = drawn_chain<Space, 3>(random, 3);
  const auto member = drawn_members<Space, 3>(random, 3, 1, 1)[0];
  WithTangent<Space> rods_with(3);
  typename WithTangent<Space>::Parts rods(3), found(3), restored(3);
  ChainAccelerations<Space, 3> plain(3);
  typename ChainAccelerations<Space, 3>::Parts unused(3);
  for (int i = 0; i < 3; ++i) rods[i] = WithTangent<Space>::resting();
  for (int i = 0; i < 3; ++i) unused[i] = ChainAccelerations<Space, 3>::resting();
  const ChainLinks<Space, 3, double> links(chain);
  for (int lane = 0; lane < LanePack<MemberRegister>::size; ++lane) {
    rods_with.start(lane, 0, chain, links, member.start.q.data(), member.start.v.data(), rods);
    plain.start(lane, 0, chain, links, member.start.q.data(), member.start.v.data(), unused);
  }
  EXPECT_NEAR(rods_with.tangent_squared(rods)[0], 1, 1e-14);
  rods_with.slopes({}, rods, found);
  restored = rods;
  rods_with.restore(restored);
  const double by = 1e-6;
  auto ahead = moved_rods<Space>(rods, by), behind = moved_rods<Space>(rods, -by);
  typename ChainAccelerations<Space, 3>::Parts slopes_ahead(3), slopes_behind(3);
  plain.slopes({}, ahead, slopes_ahead);
  plain.slopes({}, behind, slopes_behind);
  plain.restore(ahead);
  plain.restore(behind);
  for (int i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < Space::dimension; ++k) {
      const auto difference = [&](const auto& a, const auto& b) { return (a[0] - b[0]) / (2 * by); };
      const double acceleration = found[i].rate[k].slope[0];
      EXPECT_EQ(found[i].place[k].slope[0], rods[i].rate[k].slope[0]);
      EXPECT_NEAR(difference(slopes_ahead[i].rate[k], slopes_behind[i].rate[k]), acceleration, 1e-7);  // 4e-9
      EXPECT_NEAR(difference(ahead[i].place[k], behind[i].place[k]), restored[i].place[k].slope[0], 1e-9);
      EXPECT_NEAR(difference(ahead[i].rate[k], behind[i].rate[k]), restored[i].rate[k].slope[0], 1e-8);  // 2e-10
      EXPECT_NEAR(restored[i].place[k].slope[0], rods[i].place[k].slope[0], 1e-15);  // it lies where it should already
    }
  }
}

TEST(EnsembleLanesTest, TangentsAreDerivatives) {
  expect_derivatives<Planar>();
  expect_derivatives<Spatial>();
}

// Members move as they do without, to the last bit, and tangents do not see those of other lanes.
TEST(EnsembleLanesTest, TangentsChangeNothing) {
  std::mt19937 random(13);
  const auto chain = drawn_chain<Spatial, 2>(random, 2);
  const auto members = drawn_members<Spatial, 2>(random, 2, 19, 2);
  const QueueOptions options{.tolerance = 1e-8};
  const auto expected = ends_of<ExplicitLanes<Spatial, DormandPrince5, 2>>(chain, members, options);
  TangentLanes<Spatial, DormandPrince5, 2> queue(2, options);
  test::Growths all(members.size());
  queue.set_watch(all);
  const auto ends = ends_by(queue, 4, plain_members(chain, members));
  for (std::size_t k = 0; k < members.size(); ++k) {
    EXPECT_TRUE(same_bits(ends[k], expected[k])) << k;
    TangentLanes<Spatial, DormandPrince5, 2> lonely(2, options);
    test::Growths alone(1);
    lonely.set_watch(alone);
    ends_by(lonely, 4, std::vector{plain_members(chain, members)[k]});
    EXPECT_EQ(alone.grown[0], all.grown[k]) << k;
    EXPECT_GT(std::abs(alone.grown[0]), 1e-3);
  }
}

TEST(EnsembleLanesTest, MembersThatDoNotFitAreRefused) {
  std::mt19937 random(11);
  const auto chain = drawn_chain<Planar>(random, 3);
  auto members = drawn_members<Planar, any>(random, 2, 1, 1);
  MemberEnds ends(3, 1);
  GaussLanes<Planar, 1> queue(2, {.step = 1e-3});
  EXPECT_THROW(queue.run(plain_members(chain, members), ends.all()), std::invalid_argument);
  EXPECT_THROW(queue.run({}, ends.all()), std::invalid_argument);
  EXPECT_THROW((ExplicitLanes<Planar, ClassicalRungeKutta, 2>(2, {})), std::invalid_argument);
}

}  // namespace
}  // namespace pendula
