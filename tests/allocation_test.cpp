// No allocation inside a step: every operator new and malloc between two steps is counted.

#include <atomic>
#include <cstdlib>
#include <new>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace {
std::atomic<long> allocations{0};
}  // namespace

// glibc's own entry points, so that this sees Eigen's malloc as well as operator new.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
}

namespace pendula::test {
namespace {

template <class Space>
long allocations_in_steps(const Chain<Space>& chain, const State<Space>& start, const RunOptions& options) {
  const auto integrator = make_integrator(chain, options);
  EXPECT_TRUE(integrator->start(start));
  EXPECT_TRUE(integrator->step(1e-3));
  const long before = allocations;
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(integrator->step(1e-3));
  return allocations - before;
}

TEST(Allocation, IsSeenByTheCounter) {
  const long before = allocations;
  const Eigen::VectorXd vector(100);
  EXPECT_GT(allocations, before) << vector.size();
}

TEST(Allocation, NoneInAStep) {
  Random random(1);
  const Chain<Planar> planar = random_chain<Planar>(random, 4, true);
  const Chain<Spatial> spatial = random_chain<Spatial>(random, 3, true);
  const State<Planar> planar_start = random_state<Planar>(random, 4);
  const State<Spatial> spatial_start = random_state<Spatial>(random, 3);
  for (int stages = 1; stages <= 8; ++stages) {
    for (Form form : {Form::momentum, Form::velocity}) {
      EXPECT_EQ(allocations_in_steps(planar, planar_start, gauss(stages, form)), 0) << stages << " stages";
      EXPECT_EQ(allocations_in_steps(spatial, spatial_start, gauss(stages, form)), 0) << stages << " stages";
    }
  }
}

}  // namespace
}  // namespace pendula::test
