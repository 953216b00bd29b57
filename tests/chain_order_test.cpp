// The order of the chain solver away from poles, at every number of stages where it can be measured.

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

RunOptions along_chain(int stages) {
  RunOptions options;
  options.stages = stages;
  options.solver = Solver::chain;
  return options;
}

/// Slope of the error after `duration` over step sizes duration/count, where they are asymptotic and above round-off.
template <class Space>
double order(const State<Space>& start, int stages, double duration, const std::vector<double>& counts) {
  const Chain<Space> chain = equal_chain<Space>(start.links());
  const State<Space> reference = final_state(chain, start, along_chain(8), duration / 128, duration);
  ErrorLadder ladder;
  for (double count : counts) {
    const double step = duration / count;
    ladder.steps.push_back(step);
    ladder.errors.push_back(distance(final_state(chain, start, along_chain(stages), step, duration), reference));
  }
  return ladder.slope(3e-15);  // angles go up to eight radians, whose last place is 9e-16
}

class ChainOrder : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Stages, ChainOrder, ::testing::Range(1, 7));

const std::vector<double>& counts(int stages) {
  static const std::vector<double> few{48, 64, 96, 128, 192}, four{40, 48, 56, 64};
  return stages < 4 ? few : four;
}

// From five stages on, two links are not yet asymptotic where their error reaches round-off: one link is.
TEST_P(ChainOrder, IsTwiceTheStagesInThePlane) {
  const int stages = GetParam();
  const auto two = State<Planar>::from_angles(Eigen::Vector2d(1.0, 0.4), Eigen::Vector2d(0.2, -0.5));
  const auto one = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, 0.3), Eigen::VectorXd::Constant(1, 0.2));
  const double slope = stages < 5    ? order(two, stages, 1, counts(stages))
                       : stages == 5 ? order(one, stages, 2, {8, 9, 10, 11, 12, 14})
                                     : order(one, stages, 2, {7, 8, 9, 10, 11});
  EXPECT_NEAR(slope, 2 * stages, 0.3);  // measured within 0.20, without fused multiply-add 0.23
}

TEST_P(ChainOrder, IsTwiceTheStagesInSpace) {
  const int stages = GetParam();
  const auto two = State<Spatial>::from_angles(Eigen::Vector2d(1.1, 0.9), Eigen::Vector2d(0.3, -0.6),
                                               Eigen::Vector2d(0.1, 0.1), Eigen::Vector2d(3, 2.5));
  const auto only = [](double x) { return Eigen::VectorXd::Constant(1, x); };
  const auto one = State<Spatial>::from_angles(only(1.1), only(0.3), only(0.1), only(4));
  const double slope = stages < 5    ? order(two, stages, 1, counts(stages))
                       : stages == 5 ? order(one, stages, 2, {14, 16, 18, 20, 24, 28})
                                     : order(one, stages, 2, {14, 16, 18, 20, 22, 24});
  EXPECT_NEAR(slope, 2 * stages, 0.3);  // measured within 0.15
}

}  // namespace
}  // namespace pendula::test
