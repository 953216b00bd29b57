// The derivative of a step over a generated kernel is that of the discrete step: in all variables, parameters and
// inputs, symplectic, and pulled by its transpose.

#include <pendula/chain/chain_numbers.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/system/lagrangian_variation.hpp>

#include "support/kernels.hpp"
#include "support/tangents.hpp"

namespace pendula::test {
namespace {

template <class Kernel>
class KernelTangents : public ::testing::Test {
 protected:
  using Space = SpaceOf<Kernel>;
  static constexpr int K = Kernel::coordinates;

  KernelTangents()
      : chain(driven_chain<Space>(random, Kernel::links)),
        model(system_of<Kernel>(chain)),
        start(random_state<Space>(random, Kernel::links)) {
    start.time = 0.3;
  }

  static Eigen::VectorXd end(const SystemModel& moved, const Motion& from, int stages, double h) {
    GaussStepper<LagrangianSolver<>> stepper(moved, stages);
    EXPECT_TRUE(stepper.start(from));
    EXPECT_TRUE(stepper.step(h));
    Eigen::VectorXd end(2 * K);
    end << stepper.state().q, stepper.state().v;
    return end;
  }

  Eigen::VectorXd end_of(int k, double change, int stages, double h) const {
    Motion from = start;
    (k < K ? from.q[k] : from.v[k - K]) += change;
    return end(model, from, stages, h);
  }

  // Kernels number their parameters as chains do.
  Eigen::VectorXd end_with(int k, double change, int stages, double h) const {
    return end(system_of<Kernel>(varied(chain, k, change)), start, stages, h);
  }

  Random random{7};
  Chain<Space> chain;
  SystemModel model;
  Motion start;
};
/// Of one link and of several; what others have is the same text.
using TangentKernels = ::testing::Types<kernels::Planar1, kernels::Planar3, kernels::Spatial1, kernels::Spatial2>;
TYPED_TEST_SUITE(KernelTangents, TangentKernels, KernelName);

TYPED_TEST(KernelTangents, AreThoseOfTheDiscreteStep) {
  constexpr int size = 2 * TypeParam::coordinates;
  for (const int stages : {1, 2, 3, 6}) {
    for (const double h : {0.01, 0.1}) {
      GaussStepper<LagrangianSolver<>> stepper(this->model, stages);
      stepper.linearize();
      ASSERT_TRUE(stepper.start(this->start));
      ASSERT_TRUE(stepper.step(h));
      auto& step = stepper.linearization();
      const LagrangianVariation at_start(this->model, this->start);
      const LagrangianVariation at_end(this->model, stepper.state());
      Directions<> tangents, found, sensitivities, found_of_parameters;
      at_start.tangents(identity(size), tangents);
      step.push(tangents);
      at_end.rates(tangents, found);
      const Directions<> parameters = identity(step.parameters());
      at_start.tangents(Directions<>::Zero(size, parameters.cols()), sensitivities, parameters);
      step.push(sensitivities, parameters);
      at_end.rates(sensitivities, found_of_parameters, parameters);
      // Measured 2.4e-12 and 2.7e-12, of the differences.
      for (int k = 0; k < size; ++k) {
        const auto expected = difference_quotient([&](double c) { return this->end_of(k, c, stages, h); }, 2e-3);
        EXPECT_LT(distance(found.col(k), expected), 1e-10) << stages << " stages, variable " << k;
      }
      for (int k = 0; k < parameters.cols(); ++k) {
        const auto expected = difference_quotient([&](double c) { return this->end_with(k, c, stages, h); }, 2e-3);
        EXPECT_LT(distance(found_of_parameters.col(k), expected), 1e-10) << stages << " stages, parameter " << k;
      }
    }
  }
}

TYPED_TEST(KernelTangents, AreSymplecticAndPulledByTheirTranspose) {
  const auto free = random_chain<SpaceOf<TypeParam>>(this->random, TypeParam::links);
  for (int stages = 1; stages <= 8; ++stages) {
    GaussStepper<LagrangianSolver<>> stepper(system_of<TypeParam>(free), stages);
    stepper.linearize();
    ASSERT_TRUE(stepper.start(this->start));
    ASSERT_TRUE(stepper.step(0.05));
    auto& step = stepper.linearization();
    const Directions<> matrix = step.matrix();
    EXPECT_LT(distance(symplectic_form(matrix), symplectic_form(identity(step.size()))), 1e-13);  // measured 6.7e-16
    Directions<> of_parameters = Directions<>::Zero(step.size(), step.parameters());
    step.push(of_parameters, identity(step.parameters()));
    Directions<> gradients = identity(step.size());
    Directions<> of_numbers = Directions<>::Zero(step.parameters(), step.size());
    step.pull(gradients, of_numbers);
    EXPECT_LT(distance(gradients, matrix.transpose()), 1e-15);          // measured 0
    EXPECT_LT(distance(of_numbers, of_parameters.transpose()), 1e-15);  // measured 0
  }
}

// A few are solved for by themselves, as long as fixed points contract: of the longest steps here they do not.
TYPED_TEST(KernelTangents, AreTheSameOneByOne) {
  for (const int stages : {1, 2, 3, 4, 5, 8}) {
    for (const double h : {-0.02, 0.01, 0.1, 0.4}) {
      GaussStepper<LagrangianSolver<>> stepper(this->model, stages);
      stepper.linearize();
      ASSERT_TRUE(stepper.start(this->start));
      ASSERT_TRUE(stepper.step(h));
      const auto untouched = stepper.linearization();
      auto step = untouched;
      const Directions<> matrix = step.matrix();
      for (int k = 0; k < step.size(); ++k) {
        auto alone = untouched;
        Directions<> tangent = identity(step.size()).col(k);
        alone.push(tangent);
        EXPECT_LT(distance(tangent, matrix.col(k)), 1e-13) << stages << " stages, " << h;  // measured 1.6e-14
      }
    }
  }
}

}  // namespace
}  // namespace pendula::test
