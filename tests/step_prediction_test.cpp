// What the stages of a step of one motion are predicted from.

#include <gtest/gtest.h>

#include <ostream>
#include <pendula/gauss/step_prediction.hpp>

namespace pendula::test {
namespace {

constexpr int stages = 8, most = 1;  // so many that one step predicts best
constexpr double polynomial_gain = 7;

struct Source {
  double ratio;
  bool follows, again, cold;
  bool operator==(const Source&) const = default;
};
constexpr Source cold{1, false, false, true};

std::ostream& operator<<(std::ostream& out, const Source& source) {
  return out << source.ratio << " " << source.follows << source.again << source.cold;
}

class StepPredictions : public testing::Test {
 protected:
  Source next(double h, PredictedFrom from = PredictedFrom::last_step) {
    const auto [ratio, kind] = prediction.next({0, h, from}, stages, most);
    return {ratio, kind.follows, kind.again, kind.cold};
  }

  double gain() const {
    return prediction.gain([] { return polynomial_gain; });
  }

  StepPrediction prediction;
};

TEST_F(StepPredictions, AreFromTheLastStepUnlessThisOneIsMuchLonger) {
  EXPECT_EQ(next(0.5), cold) << "there was no step";
  prediction.accept();
  EXPECT_EQ(next(0.5), (Source{1, true, false, false}));
  EXPECT_EQ(gain(), polynomial_gain);
  prediction.accept();
  EXPECT_EQ(next(0.125), (Source{0.25, true, false, false}));
  prediction.accept();
  EXPECT_EQ(next(0.25), cold) << "twice as long";
  EXPECT_EQ(gain(), 1);
}

TEST_F(StepPredictions, KnowNothingAfterAStepThatFailed) {
  next(0.5);
  prediction.accept();
  next(0.5);  // and is not accepted
  EXPECT_EQ(prediction.last_h(), 0);
  EXPECT_EQ(next(0.25), cold);
}

TEST_F(StepPredictions, AreFromTheSameStepWhereItWasSolved) {
  next(0.5);
  EXPECT_EQ(next(0.125, PredictedFrom::same_step), (Source{0.25, false, true, false})) << "not accepted";
  EXPECT_EQ(next(0.0625, PredictedFrom::same_step), (Source{0.5, false, true, false})) << "nor this one";
  prediction.accept();
  EXPECT_EQ(next(0.03125, PredictedFrom::same_step), (Source{0.5, false, true, false})) << "accepted";
}

TEST_F(StepPredictions, AreFromNothingWhereThatIsAskedFor) {
  next(0.5);
  prediction.accept();
  EXPECT_EQ(next(0.5, PredictedFrom::nothing), cold);
}

TEST_F(StepPredictions, AreFromNothingAfterForgetting) {
  next(0.5);
  prediction.accept();
  prediction.forget();
  EXPECT_EQ(next(0.5), cold);
}

// From many steps of one size, first corrections tell nothing: then one step in eight is looked at.
TEST_F(StepPredictions, FromManyStepsHaveNoGainInOneStepOfEight) {
  int without = 0;
  for (int step = 0; step < 64; ++step) {
    prediction.next({0, 0.5}, 2, 8);
    if (gain() == 0) ++without;
    prediction.accept();
  }
  EXPECT_EQ(without, 7);  // not the first of these steps, which has no step before it
}

}  // namespace
}  // namespace pendula::test
