// The copyable state of a run: cut anywhere, a run goes on in another integrator to the last bit as if never cut.

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/run/integrator.hpp>
#include <stdexcept>
#include <vector>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

/// Steps of a run, cut before each of `cuts`: the end must be that of the run in one.
template <class Space>
void expect_the_same_end(const Chain<Space>& chain, const State<Space>& start, const RunOptions& options, int steps,
                         const std::vector<int>& cuts) {
  const auto whole = make_integrator(chain, options);
  auto part = make_integrator(chain, options);
  ASSERT_TRUE(whole->start(start));
  ASSERT_TRUE(part->start(start));
  for (int step = 0; step < steps; ++step) {
    if (std::ranges::find(cuts, step) != cuts.end()) {
      const Member member = part->member();
      part = make_integrator(chain, options);
      part->resume(member);
      ASSERT_TRUE(part->member() == member);
    }
    const Outcome outcome = whole->step(options.step), again = part->step(options.step);
    ASSERT_EQ(outcome.status, again.status);
    ASSERT_TRUE(whole->member() == part->member())
        << "step " << step << " of " << options.method << ", " << options.stages << " stages, " << options.solver;
  }
  EXPECT_EQ(whole->state().q, part->state().q);
  EXPECT_EQ(whole->statistics().newton_iterations, part->statistics().newton_iterations);
}

std::vector<int> random_cuts(Random& random, int steps) {
  std::vector<int> cuts{0, 1};
  for (int k = 0; k < 20; ++k) cuts.push_back(static_cast<int>(random.uniform(0, steps)));
  return cuts;
}

std::vector<RunOptions> every_method(double step) {
  std::vector<RunOptions> all;
  RunOptions options;
  options.step = step;
  const auto with_stages = [&](std::initializer_list<int> stages) {
    for (const int s : stages) {
      options.stages = s;
      all.push_back(options);
    }
  };
  for (const Solver solver : {Solver::chain, Solver::dense}) {
    options.solver = solver;
    options.method = Method::gauss;
    with_stages({1, 2, 3, 4, 5, 6, 7, 8});
    options.method = Method::radau;
    with_stages({2, 3});
  }
  options.method = Method::gauss;
  options.form = Form::velocity;
  with_stages({2, 5});
  options.form = Form::momentum;
  for (const Method method : {Method::rk4, Method::dopri5, Method::fehlberg78, Method::taylor}) {
    options.method = method;
    all.push_back(options);
  }
  return all;
}

bool has_loads(const RunOptions& options) {
  return options.method != Method::taylor;
}

TEST(Member, OfEveryMethodGoesOnToTheLastBit) {
  Random random(3);
  for (const RunOptions& options : every_method(0.02)) {
    const Chain<Planar> planar = has_loads(options) ? driven_chain<Planar>(random, 3) : random_chain<Planar>(random, 3);
    expect_the_same_end(planar, random_state<Planar>(random, 3), options, 200, random_cuts(random, 200));
    const Chain<Spatial> spatial = random_chain<Spatial>(random, 2);
    expect_the_same_end(spatial, random_state<Spatial>(random, 2), options, 200, random_cuts(random, 200));
  }
}

// Steps that are taken in parts, and the choice between Newton and the fixed point, which changes on the way.
TEST(Member, OfLongStepsGoesOnToTheLastBit) {
  Random random(4);
  RunOptions options;
  options.step = 0.2;
  for (const Solver solver : {Solver::chain, Solver::dense}) {
    options.solver = solver;
    for (const int stages : {2, 4, 8}) {
      options.stages = stages;
      const Chain<Planar> chain = driven_chain<Planar>(random, 3);
      expect_the_same_end(chain, random_state<Planar>(random, 3), options, 300, random_cuts(random, 300));
    }
  }
}

TEST(Member, OfAWhipAndOfAPoleGoesOnToTheLastBit) {
  Random random(5);
  RunOptions options;
  options.stages = 4;
  options.step = 2e-3;
  const auto horizontal = State<Planar>::from_angles(Eigen::VectorXd::Constant(100, 1.57));
  expect_the_same_end(equal_chain<Planar>(100, 9.81, 0.01), horizontal, options, 300, random_cuts(random, 300));
  // Straight through the pole: no angular momentum about the vertical.
  const auto swing = State<Spatial>::from_angles(Eigen::Vector3d(2, 1.5, 1), Eigen::Vector3d::Zero());
  options.step = 0.01;
  expect_the_same_end(equal_chain<Spatial>(3), swing, options, 300, random_cuts(random, 300));
}

/// Steps of its own choice, each found again with an end a little beyond where it came to. Where the end does not cut
/// it, it must be the same; returns of how many the first try was cut, and failed.
template <class Space>
int expect_the_same_before_an_end(const Chain<Space>& chain, const State<Space>& start, const RunOptions& options,
                                  Random& random) {
  const auto free = make_integrator(chain, options), ended = make_integrator(chain, options);
  EXPECT_TRUE(free->start(start));
  int failed = 0;
  for (int step = 0; step < 500; ++step) {
    ended->resume(free->member());
    const std::int64_t rejected = free->statistics().rejected_steps;
    const Outcome outcome = free->step(std::numeric_limits<double>::infinity());
    EXPECT_TRUE(outcome);
    if (free->statistics().rejected_steps == rejected) continue;
    const double end = outcome.step * random.uniform(1.01, 1.5);
    const Outcome again = ended->step(end);
    if (again.step == end) continue;  // cut, and good enough
    ++failed;
    EXPECT_TRUE(free->member() == ended->member()) << "step " << step << " of " << options.method;
  }
  return failed;
}

TEST(Member, OfAStepThatAnEndCutAndThatFailsIsThatOfOneWithoutAnEnd) {
  Random random(6);
  int failed = 0;
  for (RunOptions options : every_method(0)) {
    if (!is_adaptive(options)) continue;
    options.tolerance = 1e-7;
    const Chain<Planar> planar = random_chain<Planar>(random, 3);
    failed += expect_the_same_before_an_end(planar, random_state<Planar>(random, 3), options, random);
    const Chain<Spatial> spatial =
        has_loads(options) ? driven_chain<Spatial>(random, 2) : random_chain<Spatial>(random, 2);
    failed += expect_the_same_before_an_end(spatial, random_state<Spatial>(random, 2), options, random);
  }
  EXPECT_GT(failed, 400);  // measured 493
}

TEST(Member, OfAnotherSizeIsRefused) {
  RunOptions options;
  const auto integrator = make_integrator(equal_chain<Planar>(40), options);
  ASSERT_TRUE(integrator->start(State<Planar>::from_angles(Eigen::VectorXd::Constant(40, 1.0))));
  try {
    make_integrator(equal_chain<Planar>(41), options)->resume(integrator->member());
    FAIL() << "expected std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_EQ(std::string(error.what()).find("member: expected "), 0U) << error.what();
  }
}

}  // namespace
}  // namespace pendula::test
