// Members side by side whose inputs are held, each its own.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <pendula/ensemble/held_members.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/inputs.hpp>
#include <span>
#include <stdexcept>
#include <vector>

#include "support/random_chain.hpp"

namespace pendula::test {
namespace {

const RunOptions by_tolerance{.stages = 8, .step = 0, .tolerance = 1e-10};
constexpr double duration = 0.05;
const auto go_on = [] { return false; };

template <class Space>
struct Members {
  Random random{3};
  std::shared_ptr<const Subject> subject;
  std::size_t coordinates, inputs;
  std::vector<double> states, held;

  Members(int links, int count)
      : subject(std::make_shared<ChainSubject<Space>>(random_chain<Space>(random, links))),
        coordinates(static_cast<std::size_t>(Space::dof * links)),
        inputs(static_cast<std::size_t>(Space::torque_components * links)) {
    for (int k = 0; k < count; ++k) {
      const auto start = random_state<Space>(random, links);
      states.insert(states.end(), start.q.begin(), start.q.end());
      states.insert(states.end(), start.v.begin(), start.v.end());
      for (std::size_t i = 0; i < inputs; ++i) held.push_back(random.uniform(-5, 5));
    }
  }

  HeldMembers side_by_side() const { return {subject, coordinates, by_tolerance, duration}; }
};

/// How far members end from where an integrator of each one alone ends.
template <class Space>
double apart(const Members<Space>& members) {
  std::vector<double> states = members.states;
  EXPECT_TRUE(members.side_by_side().move(members.held, states, go_on).outcome);
  const auto size = static_cast<Eigen::Index>(members.coordinates);
  double apart = 0;
  for (std::size_t k = 0; k < states.size() / (2 * members.coordinates); ++k) {
    const double* const from = members.states.data() + 2 * k * members.coordinates;
    const double* const to = states.data() + 2 * k * members.coordinates;
    using Numbers = Eigen::Map<const Eigen::VectorXd>;
    RunOptions options = by_tolerance;
    options.tolerance = 1e-14;
    const auto held = std::span(members.held).subspan(k * members.inputs, members.inputs);
    const auto integrator = with_inputs(members.subject, held)->make_integrator(options);
    EXPECT_TRUE(integrator->start(Motion(0, Numbers(from, size), Numbers(from + size, size))));
    while (integrator->time() < duration) EXPECT_TRUE(integrator->step(duration - integrator->time()));
    const Motion end = integrator->state();
    apart = std::max({apart, (end.q - Numbers(to, size)).cwiseAbs().maxCoeff(),
                      (end.v - Numbers(to + size, size)).cwiseAbs().maxCoeff()});
  }
  return apart;
}

TEST(HeldMembers, GoWhereEachGoesAlone) {
  for (const int links : {1, 2, 4, 7}) {
    EXPECT_LT(apart(Members<Planar>(links, 11)), 1e-11) << links;  // measured up to 2.6e-13
    EXPECT_LT(apart(Members<Spatial>(links, 5)), 1e-11) << links;  // measured up to 4.5e-14
  }
}

// Explicit steps would be a hundred thousand.
TEST(HeldMembers, MayBeStiff) {
  Members<Planar> members(2, 3);
  const Chain<Planar> chain = random_chain<Planar>(members.random, 2);
  const Eigen::VectorXd damping = Eigen::VectorXd::Constant(2, 1e7);
  members.subject = std::make_shared<ChainSubject<Planar>>(
      Chain<Planar>({chain.masses(), chain.lengths(), chain.gravity(), damping}));
  EXPECT_LT(apart(members), 1e-14);  // measured 9.4e-17
}

TEST(HeldMembers, DependOnThemselvesAlone) {
  const Members<Planar> members(2, 11);
  std::vector<double> all = members.states, last(all.end() - 4, all.end());
  ASSERT_TRUE(members.side_by_side().move(members.held, all, go_on).outcome);
  ASSERT_TRUE(members.side_by_side().move(std::span(members.held).last(2), last, go_on).outcome);
  EXPECT_TRUE(std::ranges::equal(last, std::span(all).last(4)));
}

TEST(HeldMembers, StayWhereOneFailsOrAllAreStopped) {
  Members<Planar> members(2, 3);
  HeldMembers moved = members.side_by_side();
  std::vector<double> states = members.states;
  EXPECT_EQ(moved.move(members.held, states, [] { return true; }).outcome.status, Status::interrupted);
  EXPECT_EQ(states, members.states);
  members.states[7] = states[7] = std::numeric_limits<double>::infinity();
  const HeldMembers::MoveResult found = moved.move(members.held, states, go_on);
  EXPECT_FALSE(found.outcome);
  EXPECT_EQ(found.member, 1U);
  EXPECT_EQ(states, members.states);
}

TEST(HeldMembers, RefuseWhatTheyCannotHold) {
  Members<Planar> members(2, 3);
  EXPECT_THROW(members.side_by_side().move(std::span(members.held).first(5), members.states, go_on),
               std::invalid_argument);
  EXPECT_THROW(members.side_by_side().move(members.held, std::span(members.states).first(11), go_on),
               std::invalid_argument);
  EXPECT_THROW(HeldMembers(members.subject, 2, by_tolerance, 0), std::invalid_argument);
  Random random(1);
  EXPECT_THROW(HeldMembers(std::make_shared<ChainSubject<Planar>>(driven_chain<Planar>(random, 2)), 2, by_tolerance, 1),
               std::invalid_argument);
}

}  // namespace
}  // namespace pendula::test
