// No allocation inside a step: every operator new and malloc between two steps is counted.

#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/kernels/four_bar.hpp>
#include <pendula/system/kernel_table.hpp>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace {
std::atomic<long> allocations{0};
}  // namespace

#if defined(__has_feature)
#if __has_feature(address_sanitizer)  // as Clang says it
#define __SANITIZE_ADDRESS__ 1
#endif
#endif

#if defined(__SANITIZE_ADDRESS__)

// The sanitizer has an allocator of its own, and calls back. (g++ comes without the header that declares this.)
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*malloc_hook)(const volatile void*, std::size_t),
                                                         void (*free_hook)(const volatile void*));

namespace {
const int hooked = __sanitizer_install_malloc_and_free_hooks([](const volatile void*, std::size_t) { ++allocations; },
                                                             [](const volatile void*) {});
}  // namespace

#else

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

#endif

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

TEST(Allocation, NoneInAStepOfTheChainSolver) {
  Random random(2);
  for (int links : {1, 3, 50}) {
    const Chain<Planar> planar = random_chain<Planar>(random, links, true);
    const Chain<Spatial> spatial = random_chain<Spatial>(random, links, true);
    const State<Planar> planar_start = random_state<Planar>(random, links);
    const State<Spatial> spatial_start = random_state<Spatial>(random, links);
    for (int stages = 1; stages <= 8; ++stages) {
      for (Iteration iteration : {Iteration::newton, Iteration::fixed_point, Iteration::automatic}) {
        RunOptions options = gauss(stages);
        options.solver = Solver::chain;
        options.iteration = iteration;
        EXPECT_EQ(allocations_in_steps(planar, planar_start, options), 0) << stages << " stages, " << iteration;
        EXPECT_EQ(allocations_in_steps(spatial, spatial_start, options), 0) << stages << " stages, " << iteration;
      }
    }
  }
}

/// A chain held where its last bob is at the start, by a hook that moves.
template <class Space>
void expect_none_where_the_end_is_held(Random& random) {
  const Chain<Space> free = random_chain<Space>(random, 5, false);
  const State<Space> start = random_state<Space>(random, 5);
  ChainParameters<Space> parameters{free.masses(), free.lengths()};
  parameters.end = ChainEnd{.amplitude = {0.01, 0.02, 0.01}, .frequency = {1, 2, 3}};
  const Points<Space, Eigen::Dynamic> bobs = bob_positions(free, start);
  std::copy_n(bobs.col(4).data(), Space::dimension, parameters.end->at.data());
  for (int stages = 1; stages <= 8; ++stages) {
    RunOptions options = gauss(stages);
    options.solver = Solver::chain;
    EXPECT_EQ(allocations_in_steps(Chain<Space>(parameters), start, options), 0) << stages << " stages";
  }
}

TEST(Allocation, NoneInAStepOfAChainWhoseEndIsHeld) {
  Random random(3);
  expect_none_where_the_end_is_held<Planar>(random);
  expect_none_where_the_end_is_held<Spatial>(random);
}

TEST(Allocation, NoneInAStepOfFixedSize) {
  const Chain<Spatial, 3> chain({.masses = Eigen::Vector3d::Ones(),
                                 .lengths = Eigen::Vector3d::Ones(),
                                 .damping = Eigen::Vector3d::Zero(),
                                 .torque = Torque<Spatial, 3>::Zero()});
  GaussStepper<ChainSolver<Spatial, 2, 3>> stepper(chain, 2);
  State<Spatial, 3> start;
  start.q << 1.0, 0.5, 0.2, 0.3, 0.1, 0.4;
  start.v.setZero();
  const long before = allocations;
  ASSERT_TRUE(stepper.start(start));
  for (int i = 0; i < 500; ++i) ASSERT_TRUE(stepper.step(5e-3));
  EXPECT_EQ(allocations - before, 0) << "not even at the start";
}

TEST(Allocation, NoneInAStepTakenInParts) {
  const Chain<Planar> chain = equal_chain<Planar>(3);
  RunOptions options = gauss(8);
  const auto start = State<Planar>::from_angles(Eigen::VectorXd::Constant(3, 1.0));
  for (Solver solver : {Solver::dense, Solver::chain}) {
    options.solver = solver;
    options.iteration = Iteration::newton;
    const auto integrator = make_integrator(chain, options);
    ASSERT_TRUE(integrator->start(start));
    const long before = allocations;
    ASSERT_TRUE(integrator->step(1.5));
    EXPECT_EQ(allocations - before, 0) << solver;
    EXPECT_GT(integrator->statistics().rejected_steps, 0) << solver;
  }
}

TEST(Allocation, NoneInAStepWithConstraints) {
  // The third bar, and where it hangs, follow from the other two.
  const double a = 1.1, b = 1.9, c = std::acos(-(std::cos(a) + 1.5 * std::cos(b)) / 1.2);
  const double ground = std::sin(a) + 1.5 * std::sin(b) + 1.2 * std::sin(c);
  const std::array parameters = {9.81, ground, 0.0, 1.0, 1.0, 1.5, 2.0, 1.2, 0.3};
  const std::array torque = {0.0};
  const SystemModel model(system_table<kernels::FourBar>, {parameters.data(), torque.data(), {}});
  const Motion start(0, Eigen::Vector3d(a, b, c), Eigen::Vector3d::Zero());
  for (int stages = 1; stages <= 8; ++stages) {
    GaussStepper<LagrangianSolver<>> stepper(model, stages, {}, Iteration::fixed_point);
    ASSERT_TRUE(stepper.start(start));
    ASSERT_TRUE(stepper.step(1e-3));
    const long before = allocations;
    for (int i = 0; i < 100; ++i) ASSERT_TRUE(stepper.step(2e-3));
    EXPECT_EQ(allocations - before, 0) << stages << " stages";
  }
}

TEST(Allocation, NoneInAStep) {
  Random random(1);
  const Chain<Planar> planar = random_chain<Planar>(random, 3, true);
  const Chain<Spatial> spatial = random_chain<Spatial>(random, 2, true);
  const State<Planar> planar_start = random_state<Planar>(random, 3);
  const State<Spatial> spatial_start = random_state<Spatial>(random, 2);
  for (int stages = 1; stages <= 8; ++stages) {
    for (Form form : {Form::momentum, Form::velocity}) {
      EXPECT_EQ(allocations_in_steps(planar, planar_start, gauss(stages, form)), 0) << stages << " stages";
      EXPECT_EQ(allocations_in_steps(spatial, spatial_start, gauss(stages, form)), 0) << stages << " stages";
    }
  }
}

}  // namespace
}  // namespace pendula::test
