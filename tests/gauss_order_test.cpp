// The order of the method, its symmetry and its symplecticity: what makes it Gauss–Legendre.

#include <tuple>

#include "support/kernels.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

State<Planar> planar_start() {
  return State<Planar>::from_angles(Eigen::Vector2d(1.0, 0.4), Eigen::Vector2d(0.2, -0.5));
}

State<Spatial> spatial_start() {
  return State<Spatial>::from_angles(Eigen::Vector2d(1.1, 0.9), Eigen::Vector2d(0.3, -0.6), Eigen::Vector2d(0.1, 0.1),
                                     Eigen::Vector2d(3, 2.5));
}

/// Errors after one second, at step sizes where they are asymptotic and still above round-off.
template <class Space>
ErrorLadder ladder(const Chain<Space>& chain, const State<Space>& start, int stages, Form form) {
  const State<Space> reference = final_state(chain, start, gauss(8), 1.0 / 128, 1);
  const std::vector<double> steps =
      stages < 4 ? std::vector<double>{48, 64, 96, 128, 192} : std::vector<double>{40, 48, 56, 64};
  ErrorLadder ladder;
  for (double count : steps) {
    ladder.steps.push_back(1 / count);
    ladder.errors.push_back(distance(final_state(chain, start, gauss(stages, form), 1 / count, 1), reference));
  }
  return ladder;
}

using StagesAndForm = std::tuple<int, Form>;

class Order : public ::testing::TestWithParam<StagesAndForm> {
 protected:
  int stages() const { return std::get<0>(GetParam()); }
  Form form() const { return std::get<1>(GetParam()); }
};

INSTANTIATE_TEST_SUITE_P(Stages, Order,
                         ::testing::Combine(::testing::Range(1, 5), ::testing::Values(Form::momentum, Form::velocity)),
                         [](const ::testing::TestParamInfo<StagesAndForm>& test) {
                           return std::string(std::get<1>(test.param) == Form::momentum ? "momentum" : "velocity") +
                                  std::to_string(std::get<0>(test.param));
                         });

constexpr double plateau = 1e-14;  // errors of the finest steps settle at 4e-16 to 3e-15, which is part of those below

TEST_P(Order, IsTwiceTheStagesInThePlane) {
  const ErrorLadder rungs = ladder(equal_chain<Planar>(2), planar_start(), stages(), form());
  EXPECT_NEAR(rungs.slope(plateau), 2 * stages(), 0.2);  // measured within 0.16 (velocity form), most 0.005
}

TEST_P(Order, IsTwiceTheStagesInSpace) {
  const ErrorLadder rungs = ladder(equal_chain<Spatial>(2), spatial_start(), stages(), form());
  EXPECT_NEAR(rungs.slope(plateau), 2 * stages(), 0.2);  // measured within 0.16 (velocity form), most 0.005
}

TEST_P(Order, TimeReversalReturnsToTheStart) {
  const Chain<Spatial> chain = equal_chain<Spatial>(2);
  const auto integrator = make_integrator(chain, gauss(stages(), form()));
  ASSERT_TRUE(integrator->start(spatial_start()));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(integrator->step(0.01));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(integrator->step(-0.01));
  EXPECT_LT(distance(integrator->state(), spatial_start()), 1e-14);  // measured 1.5e-15
}

/// (q, p) after one step from (q, p), for a planar double pendulum.
Eigen::Vector4d step_map(const Chain<Planar>& chain, const Eigen::Vector4d& qp, int stages, Form form) {
  const auto parameters = parameters_of<kernels::Planar2>(chain);
  Eigen::Vector2d q = qp.head<2>(), v, p;
  Eigen::Vector2d momentum = qp.tail<2>();
  kernels::Planar2::velocity_from_momentum(parameters, q, momentum, v);
  const auto integrator = make_integrator(chain, gauss(stages, form));
  EXPECT_TRUE(integrator->start({0, q, v}));
  EXPECT_TRUE(integrator->step(0.1));
  const State<Planar> state = integrator->state();
  q = state.q;
  v = state.v;
  kernels::Planar2::momentum_from_velocity(parameters, q, v, p);
  return (Eigen::Vector4d() << q, p).finished();
}

/// |Dᵀ J D − J| of the step map's Jacobian D, by differences of order 6.
double symplectic_defect(int stages, Form form) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const Eigen::Vector4d at(1.0, 0.4, 0.3, -0.6);
  constexpr double e = 1e-2;
  Eigen::Matrix4d D;
  for (int j = 0; j < 4; ++j) {
    const auto shifted = [&](double k) { return step_map(chain, at + k * e * Eigen::Vector4d::Unit(j), stages, form); };
    D.col(j) =
        (45 * (shifted(1) - shifted(-1)) - 9 * (shifted(2) - shifted(-2)) + (shifted(3) - shifted(-3))) / (60 * e);
  }
  Eigen::Matrix4d J = Eigen::Matrix4d::Zero();
  J.topRightCorner<2, 2>().setIdentity();
  J.bottomLeftCorner<2, 2>() = -Eigen::Matrix2d::Identity();
  return (D.transpose() * J * D - J).cwiseAbs().maxCoeff();
}

TEST_P(Order, MomentumFormIsSymplecticAndVelocityFormIsNot) {
  const double defect = symplectic_defect(stages(), form());
  if (form() == Form::momentum) {
    EXPECT_LT(defect, 1e-11);  // measured 8e-13
  } else if (stages() == 1) {
    EXPECT_GT(defect, 1e-6) << "the test would not see a method that is not symplectic";
  }
}

}  // namespace
}  // namespace pendula::test
