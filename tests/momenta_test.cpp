#include <pendula/chain/momenta.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "support/kernels.hpp"

namespace pendula::test {
namespace {

template <class Kernel>
class KernelMomenta : public ::testing::Test {};

TYPED_TEST_SUITE(KernelMomenta, CommittedKernels, KernelName);

TYPED_TEST(KernelMomenta, AreThoseOfTheMassMatrix) {
  using Kernel = TypeParam;
  using Space = SpaceOf<Kernel>;
  const KernelInputs<Kernel> in(1);
  typename Kernel::template Matrix<double> mass;
  Kernel::mass_matrix(in.parameters, in.q, mass);
  const Coordinates<Space, Eigen::Dynamic> p = mass * in.v;
  const double scale = p.cwiseAbs().maxCoeff();
  EXPECT_LT((momenta(in.chain, State<Space>{0, in.q, in.v}) - p).cwiseAbs().maxCoeff(),
            4e-15 * scale);  // measured 8.9e-16
}

template <class Space>
double way_back(int links, unsigned seed) {
  Random random(seed);
  const Chain<Space> chain = random_chain<Space>(random, links);
  const State<Space> state = random_state<Space>(random, links);
  return (rates_from_momenta(chain, state.q, momenta(chain, state)) - state.v).cwiseAbs().maxCoeff();
}

TEST(Momenta, RatesComeBack) {
  double planar = 0, spatial = 0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    for (const int links : {1, 2, 3, 9, 100}) {
      planar = std::max(planar, way_back<Planar>(links, seed));
      spatial = std::max(spatial, way_back<Spatial>(links, seed));
    }
  }
  EXPECT_LT(planar, 1e-11);   // measured 4.7e-13
  EXPECT_LT(spatial, 1e-11);  // measured 6.3e-13
}

// θ_2 = 0 and π: φ_2 has no meaning, the other three rates do.
TEST(Momenta, AtAPoleTheOtherRatesComeBack) {
  Random random(3);
  const Chain<Spatial> chain = random_chain<Spatial>(random, 3);
  for (const double pole : {0.0, std::numbers::pi, -7 * std::numbers::pi}) {
    State<Spatial> state = random_state<Spatial>(random, 3);
    state.q[1] = pole;
    state.v[4] = 0;
    Coordinates<Spatial, Eigen::Dynamic> p = momenta(chain, state);
    EXPECT_LT(std::abs(p[4]), 1e-14);  // measured 1.6e-16
    p[4] = 0;
    EXPECT_LT((rates_from_momenta(chain, state.q, p) - state.v).cwiseAbs().maxCoeff(), 1e-13)
        << pole;  // measured 5.3e-15
    p[4] = 1e-3;
    try {
      rates_from_momenta(chain, state.q, p);
      FAIL() << "no error";
    } catch (const std::invalid_argument& error) {
      EXPECT_STREQ(error.what(), "link 2: expected 0 where sin(theta) = 0");
    }
  }
}

}  // namespace
}  // namespace pendula::test
