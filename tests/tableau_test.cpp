#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <pendula/gauss/tableau.hpp>

namespace pendula {
namespace {

class EveryTableau : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Stages, EveryTableau, ::testing::Range(1, max_stages + 1));

// B(2s): Σ b_i c_i^{k−1} = 1/k for k ≤ 2s, and C(s): Σ_j a_ij c_j^{k−1} = c_i^k / k for k ≤ s make the order 2s.
TEST_P(EveryTableau, MeetsTheOrderConditions) {
  const Tableau<> tableau = tableau_of(Family::gauss, GetParam());
  const int s = tableau.stages();
  for (int k = 1; k <= 2 * s; ++k) {
    EXPECT_NEAR(tableau.b.dot(tableau.c.array().pow(k - 1).matrix()), 1.0 / k, 5e-16);  // measured 1.1e-16
  }
  for (int k = 1; k <= s; ++k) {
    const StageVector<Eigen::Dynamic> integral = tableau.a * tableau.c.array().pow(k - 1).matrix();
    EXPECT_LT((integral.array() - tableau.c.array().pow(k) / k).abs().maxCoeff(), 1e-15);  // measured 2.2e-16
  }
}

template <class Real>
void expect_symplectic(int stages) {
  const auto tableau = tableau_of<Eigen::Dynamic, Real>(Family::gauss, stages);
  for (int i = 0; i < stages; ++i) {
    EXPECT_EQ(tableau.m(i, i), Real(0.5));
    for (int j = 0; j < stages; ++j) EXPECT_EQ(tableau.m(i, j) + tableau.m(j, i), Real(1));
  }
}

TEST_P(EveryTableau, IsSymplecticToTheLastBit) {
  expect_symplectic<float>(GetParam());
  expect_symplectic<double>(GetParam());
  expect_symplectic<long double>(GetParam());
}

// Σ_j a_ij = c_i, Σ b_i c_i = 1/2, and a_ij = m_ij b_j: in all the bits of a long double.
TEST_P(EveryTableau, HasTheBitsOfALongDouble) {
  const auto tableau = tableau_of<Eigen::Dynamic, long double>(Family::gauss, GetParam());
  constexpr long double epsilon = std::numeric_limits<long double>::epsilon();
  EXPECT_LT((tableau.a.rowwise().sum() - tableau.c).cwiseAbs().maxCoeff(), 4 * epsilon);  // measured 1
  EXPECT_LT(std::abs(tableau.b.dot(tableau.c) - 0.5L), 2 * epsilon);                      // measured 0.5
  const StageMatrix<Eigen::Dynamic, long double> from_m = tableau.m * tableau.b.asDiagonal();
  EXPECT_LT((from_m - tableau.a).cwiseAbs().maxCoeff(), 2 * epsilon);  // measured 0.25
}

TEST_P(EveryTableau, IsConsistent) {
  const Tableau<> tableau = tableau_of(Family::gauss, GetParam());
  const auto largest = [](const auto& matrix) { return matrix.cwiseAbs().maxCoeff(); };
  const StageMatrix<Eigen::Dynamic> from_m = tableau.m * tableau.b.asDiagonal();
  EXPECT_LT(largest(from_m - tableau.a), 3e-16);                         // measured 6e-17
  EXPECT_LT(largest(tableau.a * tableau.a - tableau.a_squared), 3e-16);  // measured 3e-17
}

TEST_P(EveryTableau, WeightsOfAStepSumToTheStepExactly) {
  StepCoefficients<> coefficients(tableau_of(Family::gauss, GetParam()));
  for (double h : {0.1, 1e-3, 1.0 / 3, 0.7e-5, 3.3}) {
    coefficients.prepare(h, 0);
    double sum = 0;
    const int s = coefficients.stages();
    for (int j = 1; j + 1 < s; ++j) sum += coefficients.hb(j);
    EXPECT_EQ(s == 1 ? coefficients.hb(0) : sum + 2 * coefficients.hb(0), h) << "h = " << h;
  }
}

// The predictor continues polynomials of degree s − 1 exactly, also where the step size changes.
TEST_P(EveryTableau, ExtrapolatesPolynomials) {
  const Tableau<> tableau = tableau_of(Family::gauss, GetParam());
  StepCoefficients<> coefficients(tableau);
  for (double ratio : {1.0, 0.5, 0.3}) {
    coefficients.prepare(0.1 * ratio, 0.1);
    for (int i = 0; i < tableau.stages(); ++i) {
      double extrapolated = 0;
      const auto polynomial = [&](double x) { return std::pow(x, tableau.stages() - 1); };
      for (int j = 0; j < tableau.stages(); ++j) {
        extrapolated += coefficients.extrapolation(i, j) * polynomial(tableau.c[j]);
      }
      const double expected = polynomial(1 + ratio * tableau.c[i]);
      EXPECT_NEAR(extrapolated, expected, 1e-11 * expected);  // measured 4e-13; the weights reach 1e5 at s = 8
    }
  }
}

TEST(Tableau, OfTwoStagesIsThePapers) {
  const Tableau<> tableau = tableau_of(Family::gauss, 2);
  EXPECT_EQ(tableau.a(0, 0), 0.25);
  EXPECT_EQ(tableau.a(1, 1), 0.25);
  EXPECT_NEAR(tableau.a(0, 1), 0.25 - std::sqrt(3) / 6, 1e-16);  // measured 1.4e-17
  EXPECT_NEAR(tableau.a(1, 0), 0.25 + std::sqrt(3) / 6, 1e-16);  // measured 0
  EXPECT_EQ(tableau.b[0], 0.5);
  EXPECT_EQ(tableau.b[1], 0.5);
}

TEST(Tableau, RefusesOtherStageCounts) {
  EXPECT_THROW(tableau_of(Family::gauss, 0), std::invalid_argument);
  EXPECT_THROW(tableau_of(Family::gauss, 9), std::invalid_argument);
  EXPECT_THROW(tableau_of<2>(Family::gauss, 3), std::invalid_argument);
}

}  // namespace
}  // namespace pendula
