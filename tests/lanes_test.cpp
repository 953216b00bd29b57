// Packs of numbers in SIMD registers, and their sines and cosines.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <pendula/gauss/lanes.hpp>
#include <pendula/gauss/sincos.hpp>
#include <random>

namespace pendula::test {
namespace {

template <class P>
class PackTest : public ::testing::Test {};
using Sizes = ::testing::Types<Pack<1>, Pack<2>, Pack<4>, Pack<8>>;
TYPED_TEST_SUITE(PackTest, Sizes, );

// The low part of a product is what fma(a, b, −ab) leaves: nothing, if it rounds twice as the fma of some SIMD
// libraries does.
#ifdef FP_FAST_FMA
TYPED_TEST(PackTest, FusedMultiplyAddRoundsOnce) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(1, 2);
  for (int k = 0; k < 100; ++k) {
    const double a = uniform(random), b = uniform(random);
    const TypeParam product = TypeParam(a) * TypeParam(b);
    alignas(pack_alignment) double low[TypeParam::size];
    fma(TypeParam(a), TypeParam(b), -product).store(low);
    for (double each : low) EXPECT_EQ(each, std::fma(a, b, -(a * b)));
  }
}
#endif

// Against 80-bit arithmetic, in units of the last place of a number in [1/2, 1).
TEST(SinCos, IsRightToThreeQuartersOfAnUlp) {
  constexpr double ulp = 0x1p-53;
  constexpr int count = 4096;
  std::mt19937_64 random(1);
  alignas(pack_alignment) double x[count], sine[count], cosine[count];
  for (double range : {0.8, 10.0, 1e5}) {
    std::uniform_real_distribution<double> uniform(-range, range);
    for (double& each : x) each = uniform(random);
    sincos_all(x, sine, cosine, count);
    long double worst = 0;
    for (int i = 0; i < count; ++i) {
      worst = std::max({worst, std::abs(sine[i] - std::sin(static_cast<long double>(x[i]))),
                        std::abs(cosine[i] - std::cos(static_cast<long double>(x[i])))});
    }
    EXPECT_LT(worst / ulp, 0.75) << range;  // measured 0.67, without fused multiply-add 0.72
  }
}

}  // namespace
}  // namespace pendula::test
