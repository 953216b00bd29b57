// Packs of numbers in SIMD registers, and their sines and cosines.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/sincos.hpp>
#include <random>

namespace pendula::test {
namespace {

template <class P>
class PackTest : public ::testing::Test {};
using Sizes = ::testing::Types<Pack<1>, Pack<2>, Pack<4>, Pack<8>, Lanes<1, float>, Lanes<2, float>, Lanes<3, float>,
                               Lanes<5, float>>;
TYPED_TEST_SUITE(PackTest, Sizes, );

// The low part of a product is what fma(a, b, −ab) leaves: nothing, if it rounds twice as the fma of some SIMD
// libraries does.
TYPED_TEST(PackTest, FusedMultiplyAddRoundsOnce) {
  using Real = typename TypeParam::Scalar;
  if (!detail::has_fast_fma<Real>) GTEST_SKIP() << "this processor has no such instruction";
  std::mt19937_64 random(1);
  std::uniform_real_distribution<Real> uniform(1, 2);
  for (int k = 0; k < 100; ++k) {
    const Real a = uniform(random), b = uniform(random);
    const TypeParam product = TypeParam(a) * TypeParam(b);
    alignas(pack_alignment) Real low[TypeParam::size];
    fma(TypeParam(a), TypeParam(b), -product).store(low);
    for (Real each : low) EXPECT_EQ(each, std::fma(a, b, -(a * b)));
  }
}

/// Sines and cosines of numbers in a row, by packs of `Size`.
template <int Size, class Real>
void sincos_by_packs(const Real* x, Real* sine, Real* cosine, std::ptrdiff_t count) {
  using Numbers = Pack<Size, RegisterFor<Size, Real>>;
  for (std::ptrdiff_t i = 0; i < count; i += Size) {
    Numbers s, c;
    sincos(Numbers::load(x + i), s, c);
    s.store(sine + i);
    c.store(cosine + i);
  }
}

/// Largest error of `sincos_of` on |x| < range against 80-bit arithmetic, in units of the last place of a number in
/// [1/2, 1).
template <class Real>
long double largest_error(double range, void (*sincos_of)(const Real*, Real*, Real*, std::ptrdiff_t)) {
  constexpr int count = 4096;
  std::mt19937_64 random(1);
  alignas(pack_alignment) Real x[count], sine[count], cosine[count];
  std::uniform_real_distribution<Real> uniform(static_cast<Real>(-range), static_cast<Real>(range));
  for (Real& each : x) each = uniform(random);
  sincos_of(x, sine, cosine, count);
  long double worst = 0;
  for (int i = 0; i < count; ++i) {
    worst = std::max({worst, std::abs(sine[i] - std::sin(static_cast<long double>(x[i]))),
                      std::abs(cosine[i] - std::cos(static_cast<long double>(x[i])))});
  }
  return worst / (std::numeric_limits<Real>::epsilon() / 2);
}

TEST(SinCos, IsRightToFourFifthsOfAnUlp) {
  // measured 0.67, without fused multiply-add 0.77
  for (const auto sincos_of : {sincos_all<double>, sincos_by_packs<1, double>, sincos_by_packs<2, double>,
                               sincos_by_packs<4, double>, sincos_by_packs<8, double>}) {
    for (double range : {0.8, 10.0, 1e5}) EXPECT_LT(largest_error<double>(range, sincos_of), 0.8) << range;
  }
}

TEST(SinCos, OfFloatsIsRightToAnUlpAndAQuarter) {
  for (const auto sincos_of : {sincos_all<float>, sincos_by_packs<4, float>, sincos_by_packs<8, float>}) {
    for (double range : {0.8, 10.0, 1e5}) EXPECT_LT(largest_error<float>(range, sincos_of), 1.25) << range;
  }  // measured 1.14
}

TEST(LogarithmNear, IsOffByLessThanAThousandth) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1000, 1000);
  for (int k = 0; k < 1000; ++k) {
    const double expected = uniform(random), x = std::exp2(expected);
    EXPECT_NEAR(log2_near(x), expected, 7e-4);  // measured 6.4e-4
    EXPECT_NEAR(log2_near(LanePack<MemberRegister>(x))[0], expected, 7e-4);
  }
}

}  // namespace
}  // namespace pendula::test
