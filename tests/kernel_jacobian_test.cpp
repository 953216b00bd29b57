// Every generated Jacobian against complex-step derivatives of the value-only entry point, on seeded random draws.

#include <complex>

#include "support/kernels.hpp"

namespace pendula::test {
namespace {

using Complex = std::complex<double>;

template <class Kernel>
class KernelJacobian : public ::testing::Test {
 protected:
  using Vector = typename Kernel::template Vector<double>;
  using Matrix = typename Kernel::template Matrix<double>;
  using ComplexVector = typename Kernel::template Vector<Complex>;
  using ComplexTorque = typename Kernel::template Torque<Complex>;

  static constexpr int draws = 5;

  /// d value / d x, with value(x + i ε) = value + i ε value': exact to round-off, because nothing is subtracted.
  template <class Value>
  static Matrix complex_step(const Vector& x, Value value) {
    constexpr double epsilon = 1e-40;
    Matrix derivative;
    for (int j = 0; j < Kernel::coordinates; ++j) {
      auto stepped = matrix_as<ComplexVector>(x);
      stepped[j] += Complex(0, epsilon);
      derivative.col(j) = value(stepped).imag() / epsilon;
    }
    return derivative;
  }

  static double relative_difference(const Matrix& a, const Matrix& b) {
    return (a - b).cwiseAbs().maxCoeff() / std::max(1.0, b.cwiseAbs().maxCoeff());
  }
};

TYPED_TEST_SUITE(KernelJacobian, CommittedKernels, KernelName);

constexpr double tolerance = 1e-13;  // the largest measured over all kernels, draws and Jacobians: see each test

TYPED_TEST(KernelJacobian, OfTheResidual) {
  using Kernel = TypeParam;
  using ComplexVector = typename TestFixture::ComplexVector;
  for (unsigned seed = 1; seed <= TestFixture::draws; ++seed) {
    const KernelInputs<Kernel> in(seed);
    const auto parameters = parameters_as<Kernel, Complex>(in.parameters);
    const auto torque = matrix_as<typename TestFixture::ComplexTorque>(in.torque);
    const auto q = matrix_as<ComplexVector>(in.q), v = matrix_as<ComplexVector>(in.v), a = matrix_as<ComplexVector>(in.a);
    const auto residual = [&](const ComplexVector& q, const ComplexVector& v, const ComplexVector& a) {
      ComplexVector value;
      Kernel::residual(parameters, q, v, a, torque, value);
      return value;
    };
    const auto D_q = this->complex_step(in.q, [&](const ComplexVector& x) { return residual(x, v, a); });
    const auto D_v = this->complex_step(in.v, [&](const ComplexVector& x) { return residual(q, x, a); });
    const auto D_a = this->complex_step(in.a, [&](const ComplexVector& x) { return residual(q, v, x); });

    typename TestFixture::Vector value, alone;
    typename TestFixture::Matrix E_D_q, E_D_v, E_D_a, only;
    Kernel::residual_with_jacobians(in.parameters, in.q, in.v, in.a, in.torque, value, E_D_q, E_D_v, E_D_a);
    EXPECT_LT(this->relative_difference(E_D_q, D_q), tolerance) << "seed " << seed;
    EXPECT_LT(this->relative_difference(E_D_v, D_v), tolerance) << "seed " << seed;
    EXPECT_LT(this->relative_difference(E_D_a, D_a), tolerance) << "seed " << seed;

    Kernel::residual(in.parameters, in.q, in.v, in.a, in.torque, alone);
    EXPECT_LT((value - alone).cwiseAbs().maxCoeff(), 1e-13 * (1 + alone.cwiseAbs().maxCoeff())) << "seed " << seed;
    Kernel::residual_D_q(in.parameters, in.q, in.v, in.a, in.torque, only);
    EXPECT_LT(this->relative_difference(only, E_D_q), tolerance);
    Kernel::residual_D_v(in.parameters, in.q, in.v, in.a, in.torque, only);
    EXPECT_LT(this->relative_difference(only, E_D_v), tolerance);
    Kernel::residual_D_a(in.parameters, in.q, in.v, in.a, in.torque, only);
    EXPECT_LT(this->relative_difference(only, E_D_a), tolerance);
  }
}

TYPED_TEST(KernelJacobian, OfTheMomentumForm) {
  using Kernel = TypeParam;
  using ComplexVector = typename TestFixture::ComplexVector;
  for (unsigned seed = 1; seed <= TestFixture::draws; ++seed) {
    const KernelInputs<Kernel> in(seed);
    const auto parameters = parameters_as<Kernel, Complex>(in.parameters);
    const auto torque = matrix_as<typename TestFixture::ComplexTorque>(in.torque);
    const auto q = matrix_as<ComplexVector>(in.q), v = matrix_as<ComplexVector>(in.v);
    const auto momentum = [&](const ComplexVector& q, const ComplexVector& v) {
      ComplexVector p, f;
      Kernel::momentum_form(parameters, q, v, torque, p, f);
      return p;
    };
    const auto force = [&](const ComplexVector& q, const ComplexVector& v) {
      ComplexVector p, f;
      Kernel::momentum_form(parameters, q, v, torque, p, f);
      return f;
    };

    typename TestFixture::Vector p, f, p_alone, f_alone;
    typename TestFixture::Matrix p_D_q, p_D_v, f_D_q, f_D_v;
    Kernel::momentum_form_with_jacobians(in.parameters, in.q, in.v, in.torque, p, f, p_D_q, p_D_v, f_D_q, f_D_v);
    const auto& step = [&](const auto& x, auto value) { return this->complex_step(x, value); };
    EXPECT_LT(this->relative_difference(p_D_q, step(in.q, [&](const auto& x) { return momentum(x, v); })), tolerance);
    EXPECT_LT(this->relative_difference(p_D_v, step(in.v, [&](const auto& x) { return momentum(q, x); })), tolerance);
    EXPECT_LT(this->relative_difference(f_D_q, step(in.q, [&](const auto& x) { return force(x, v); })), tolerance);
    EXPECT_LT(this->relative_difference(f_D_v, step(in.v, [&](const auto& x) { return force(q, x); })), tolerance);

    Kernel::momentum_form(in.parameters, in.q, in.v, in.torque, p_alone, f_alone);
    EXPECT_LT((p - p_alone).cwiseAbs().maxCoeff(), 1e-13 * (1 + p.cwiseAbs().maxCoeff()));
    EXPECT_LT((f - f_alone).cwiseAbs().maxCoeff(), 1e-13 * (1 + f.cwiseAbs().maxCoeff()));
  }
}

TYPED_TEST(KernelJacobian, OfTheGeneralizedForce) {
  using Kernel = TypeParam;
  using ComplexVector = typename TestFixture::ComplexVector;
  for (unsigned seed = 1; seed <= TestFixture::draws; ++seed) {
    const KernelInputs<Kernel> in(seed);
    const auto parameters = parameters_as<Kernel, Complex>(in.parameters);
    const auto torque = matrix_as<typename TestFixture::ComplexTorque>(in.torque);
    const auto q = matrix_as<ComplexVector>(in.q), v = matrix_as<ComplexVector>(in.v);
    const auto force = [&](const ComplexVector& q, const ComplexVector& v) {
      ComplexVector Q;
      Kernel::generalized_force(parameters, q, v, torque, Q);
      return Q;
    };
    typename TestFixture::Vector Q;
    typename TestFixture::Matrix Q_D_q, Q_D_v;
    Kernel::generalized_force_with_jacobians(in.parameters, in.q, in.v, in.torque, Q, Q_D_q, Q_D_v);
    const auto D_q = this->complex_step(in.q, [&](const ComplexVector& x) { return force(x, v); });
    const auto D_v = this->complex_step(in.v, [&](const ComplexVector& x) { return force(q, x); });
    EXPECT_LT(this->relative_difference(Q_D_q, D_q), tolerance);
    EXPECT_LT(this->relative_difference(Q_D_v, D_v), tolerance);
  }
}

TYPED_TEST(KernelJacobian, GradientAndHessianOfTheLagrangian) {
  using Kernel = TypeParam;
  using ComplexVector = typename TestFixture::ComplexVector;
  for (unsigned seed = 1; seed <= TestFixture::draws; ++seed) {
    const KernelInputs<Kernel> in(seed);
    const auto parameters = parameters_as<Kernel, Complex>(in.parameters);
    const auto q = matrix_as<ComplexVector>(in.q), v = matrix_as<ComplexVector>(in.v);
    const auto gradient_q = [&](const ComplexVector& q, const ComplexVector& v) {
      ComplexVector L_q, L_v;
      Kernel::lagrangian_gradient(parameters, q, v, L_q, L_v);
      return L_q;
    };
    const auto gradient_v = [&](const ComplexVector& q, const ComplexVector& v) {
      ComplexVector L_q, L_v;
      Kernel::lagrangian_gradient(parameters, q, v, L_q, L_v);
      return L_v;
    };
    const auto lagrangian = [&](const ComplexVector& q, const ComplexVector& v) {
      Complex L;
      Kernel::lagrangian(parameters, q, v, L);
      return ComplexVector(ComplexVector::Constant(L));
    };

    typename TestFixture::Vector L_q, L_v;
    typename TestFixture::Matrix L_qq, L_qv, L_vv;
    Kernel::lagrangian_gradient(in.parameters, in.q, in.v, L_q, L_v);
    Kernel::lagrangian_hessian(in.parameters, in.q, in.v, L_qq, L_qv, L_vv);
    const auto& step = [&](const auto& x, auto value) { return this->complex_step(x, value); };
    const auto of_L_q = step(in.q, [&](const auto& x) { return lagrangian(x, v); });
    const auto of_L_v = step(in.v, [&](const auto& x) { return lagrangian(q, x); });
    EXPECT_LT((L_q.transpose() - of_L_q.row(0)).cwiseAbs().maxCoeff(), 1e-12);  // measured 3e-14
    EXPECT_LT((L_v.transpose() - of_L_v.row(0)).cwiseAbs().maxCoeff(), 1e-12);  // measured 1e-14
    EXPECT_LT(this->relative_difference(L_qq, step(in.q, [&](const auto& x) { return gradient_q(x, v); })), tolerance);
    EXPECT_LT(this->relative_difference(L_qv, step(in.v, [&](const auto& x) { return gradient_q(q, x); })), tolerance);
    EXPECT_LT(this->relative_difference(L_vv, step(in.v, [&](const auto& x) { return gradient_v(q, x); })), tolerance);
  }
}

}  // namespace
}  // namespace pendula::test
