#pragma once

// The derivative of a chain's step is that of the discrete step: against differences of the step itself, in all
// variables and parameters; symplectic; its transpose. One test file a space, so that they compile side by side.

#include <string>
#include <type_traits>

#include "support/tangents.hpp"

namespace pendula::test {

template <class SpaceType, int S, class RealType = double>
struct Case {
  using Space = SpaceType;
  using Real = RealType;
  static constexpr int stages = S;
};

template <class Case>
class ChainTangents : public ::testing::Test {
 protected:
  using Run = ChainRun<typename Case::Space, Case::stages, typename Case::Real>;
  static constexpr int links = 3;
  // Of differences, which is what is not exact.
  static constexpr double exact = std::is_same_v<typename Case::Real, double> ? 5e-12 : 1e-13;  // measured 2e-13, 1e-14

  Random random{7};
};
struct CaseName {
  template <class Case>
  static std::string GetName(int) {
    const bool wide = std::is_same_v<typename Case::Real, long double>;
    return std::string(Case::Space::name) + std::to_string(Case::stages) + (wide ? "wide" : "");
  }
};
TYPED_TEST_SUITE_P(ChainTangents);

TYPED_TEST_P(ChainTangents, AreThoseOfTheDiscreteStep) {
  using Space = typename TypeParam::Space;
  for (int draw = 0; draw < 2; ++draw) {
    const Chain<Space> chain = random_chain<Space>(this->random, this->links);
    const auto start = random_state<Space>(this->random, this->links).template cast<typename TypeParam::Real>();
    const typename TestFixture::Run run(chain, start, 0.1);
    EXPECT_LT(distance(run.tangents().of_start, run.differences()), this->exact);
  }
}

// Masses, lengths, damping, gravity, torques; with damping, torque and a drive.
TYPED_TEST_P(ChainTangents, HoldLoadsAndParameters) {
  using Space = typename TypeParam::Space;
  const Chain<Space> chain = driven_chain<Space>(this->random, this->links);
  auto start = random_state<Space>(this->random, this->links).template cast<typename TypeParam::Real>();
  start.time = 0.3;
  const typename TestFixture::Run run(chain, start, 0.1);
  const auto found = run.tangents();
  EXPECT_LT(distance(found.of_start, run.differences()), this->exact);
  const auto expected = run.parameter_differences(static_cast<int>(found.of_parameters.cols()));
  EXPECT_LT(distance(found.of_parameters, expected), 5e-12);  // measured 1.8e-13
}

// Steps that do not resolve the chain's swinging carry its tension at rest along.
TYPED_TEST_P(ChainTangents, HoldWhatLongStepsCarry) {
  using Space = typename TypeParam::Space;
  const Chain<Space> chain = driven_chain<Space>(this->random, this->links);
  auto start = random_state<Space>(this->random, this->links).template cast<typename TypeParam::Real>();
  start.q.head(this->links) *= 0.3;
  start.v *= 0.1;
  const typename TestFixture::Run run(chain, start, 0.5);
  const auto found = run.tangents();
  EXPECT_LT(distance(found.of_start, run.differences()), 2e-11);  // measured 1.6e-12
  const auto expected = run.parameter_differences(static_cast<int>(found.of_parameters.cols()));
  EXPECT_LT(distance(found.of_parameters, expected), 1e-10);  // measured 2.2e-12
}

// From the pole on, in space. What a push gives is across the rods, whatever went in.
TYPED_TEST_P(ChainTangents, KeepTheSymplecticForm) {
  using Space = typename TypeParam::Space;
  const Chain<Space> chain = random_chain<Space>(this->random, 10);
  State<Space> start = random_state<Space>(this->random, 10);
  start.q[0] = 0;
  GaussStepper<ChainSolver<Space, TypeParam::stages>> stepper(chain, TypeParam::stages);
  stepper.linearize();
  ASSERT_TRUE(stepper.start(start));
  ASSERT_TRUE(stepper.step(0.01));
  Directions<> tangents = stepper.linearization().matrix();
  for (int k = 0; k < 5; ++k) {
    const Directions<> before = symplectic_form(tangents);
    ASSERT_TRUE(stepper.step(0.01));
    stepper.linearization().push(tangents);
    EXPECT_LT(distance(symplectic_form(tangents), before), 3e-13);  // measured 2.8e-14
  }
}

TYPED_TEST_P(ChainTangents, ArePulledByTheirTranspose) {
  using Space = typename TypeParam::Space;
  const Chain<Space> chain = driven_chain<Space>(this->random, 7);
  GaussStepper<ChainSolver<Space, TypeParam::stages>> stepper(chain, TypeParam::stages);
  stepper.linearize();
  ASSERT_TRUE(stepper.start(random_state<Space>(this->random, 7)));
  ASSERT_TRUE(stepper.step(0.05));
  auto& step = stepper.linearization();
  const Directions<> of_start = step.matrix();
  Directions<> of_parameters = Directions<>::Zero(step.size(), step.parameters());
  step.push(of_parameters, identity(step.parameters()));
  Directions<> gradients = identity(step.size());
  Directions<> of_numbers = Directions<>::Zero(step.parameters(), step.size());
  step.pull(gradients, of_numbers);
  EXPECT_LT(distance(gradients, of_start.transpose()), 1e-14);        // measured 7.5e-16
  EXPECT_LT(distance(of_numbers, of_parameters.transpose()), 1e-14);  // measured 1.4e-15
}

REGISTER_TYPED_TEST_SUITE_P(ChainTangents, AreThoseOfTheDiscreteStep, HoldLoadsAndParameters, HoldWhatLongStepsCarry,
                            KeepTheSymplecticForm, ArePulledByTheirTranspose);

/// Some numbers of stages, odd and even, and one in long double, whose differences are as good as exact.
#ifdef PENDULA_FEW_KERNELS
template <class Space>
using TangentCases = ::testing::Types<Case<Space, 2>, Case<Space, 5>>;
#else
template <class Space>
using TangentCases =
    ::testing::Types<Case<Space, 1>, Case<Space, 2>, Case<Space, 5>, Case<Space, 8>, Case<Space, 2, long double>>;
#endif

}  // namespace pendula::test
