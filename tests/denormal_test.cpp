// No step along the chain computes with denormal numbers: what stands beyond the last column of a block or after the
// last stage of a pack is never looked at, but processors are slow with such numbers: Newton took up to 15 times as
// long.

#if defined(__SSE2__)

#include <xmmintrin.h>

#include <array>
#include <pendula/chain/chain_solver.hpp>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

constexpr double denormal = 1e-310;
constexpr unsigned denormal_operand = 0x2;  // of the control and status register

/// What the next functions called will find where they keep their own values.
[[gnu::noinline]] void fill_stack() {
  std::array<volatile double, 32768> values;
  for (volatile double& value : values) value = denormal;
}

/// Whether a processor has met a denormal number in `work`.
template <class Work>
bool meets_denormals(Work work) {
  _mm_setcsr(_mm_getcsr() & ~denormal_operand);
  work();
  return (_mm_getcsr() & denormal_operand) != 0;
}

TEST(Denormal, IsSeenWhereItIs) {
  volatile double value = denormal;
  EXPECT_TRUE(meets_denormals([&] { value = value * 1.5; }));
  EXPECT_FALSE(meets_denormals([&] { value = 2.5; }));
}

template <class Space>
void expect_none(int links) {
  Random random{5};
  const Chain<Space> chain = random_chain<Space>(random, links, true);
  const State<Space> start = random_state<Space>(random, links);
  for (int stages = 1; stages <= max_stages; ++stages) {
    for (const Iteration iteration : {Iteration::newton, Iteration::fixed_point}) {
      RunOptions options;
      options.stages = stages;
      options.solver = Solver::chain;
      options.iteration = iteration;
      const auto integrator = make_integrator(chain, options);
      ASSERT_TRUE(integrator->start(start));
      const bool met = meets_denormals([&] {
        for (int step = 0; step < 5; ++step) {
          fill_stack();
          EXPECT_TRUE(integrator->step(1e-3));
        }
      });
      EXPECT_FALSE(met) << stages << " stages, " << links << " links, " << iteration;
    }
  }
}

TEST(Denormal, NoneInAStepInThePlane) {
  for (int links : {1, 2, 3, 20}) expect_none<Planar>(links);
}

TEST(Denormal, NoneInAStepInSpace) {
  for (int links : {1, 2, 3, 20}) expect_none<Spatial>(links);
}

}  // namespace
}  // namespace pendula::test

#endif
