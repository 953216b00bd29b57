// Every generated Jacobian against complex-step derivatives of the value-only entry point, on seeded random draws; and
// the same value with and without the Jacobian.

#include <complex>

#include "support/kernels.hpp"

namespace pendula::test {
namespace {

using Complex = std::complex<double>;

/// The value-only entry points of a kernel in complex numbers, at one draw of inputs.
template <class Kernel>
class ComplexKernel {
 public:
  using Vector = typename Kernel::template Vector<Complex>;
  using RealVector = typename Kernel::template Vector<double>;
  using Matrix = typename Kernel::template Matrix<double>;

  const Vector q, v, a;

  explicit ComplexKernel(const KernelInputs<Kernel>& in)
      : q(matrix_as<Vector>(in.q)),
        v(matrix_as<Vector>(in.v)),
        a(matrix_as<Vector>(in.a)),
        parameters_(parameters_as<Kernel, Complex>(in.parameters)),
        torque_(matrix_as<typename Kernel::template Torque<Complex>>(in.torque)) {}

  Vector residual(const Vector& at_q, const Vector& at_v, const Vector& at_a) const {
    Vector E;
    Kernel::residual(parameters_, at_q, at_v, at_a, torque_, E);
    return E;
  }
  Vector momentum(const Vector& at_q, const Vector& at_v) const {
    Vector p, f;
    Kernel::momentum_form(parameters_, at_q, at_v, torque_, p, f);
    return p;
  }
  Vector force(const Vector& at_q, const Vector& at_v) const {
    Vector p, f;
    Kernel::momentum_form(parameters_, at_q, at_v, torque_, p, f);
    return f;
  }
  Vector generalized_force(const Vector& at_q, const Vector& at_v) const {
    Vector Q;
    Kernel::generalized_force(parameters_, at_q, at_v, torque_, Q);
    return Q;
  }
  Vector L_q(const Vector& at_q, const Vector& at_v) const {
    Vector L_q, L_v;
    Kernel::lagrangian_gradient(parameters_, at_q, at_v, L_q, L_v);
    return L_q;
  }
  Vector L_v(const Vector& at_q, const Vector& at_v) const {
    Vector L_q, L_v;
    Kernel::lagrangian_gradient(parameters_, at_q, at_v, L_q, L_v);
    return L_v;
  }
  Complex lagrangian(const Vector& at_q, const Vector& at_v) const {
    Complex L;
    Kernel::lagrangian(parameters_, at_q, at_v, L);
    return L;
  }

  /// d value / d x from value(x + i ε) = value + i ε value': exact to round-off, because nothing is subtracted.
  template <class Value>
  static Matrix derivative(const Vector& x, Value value) {
    Matrix derivative;
    for (int j = 0; j < Kernel::coordinates; ++j) derivative.col(j) = value(stepped(x, j)).imag() / epsilon;
    return derivative;
  }

  template <class Value>
  static RealVector gradient(const Vector& x, Value value) {
    RealVector gradient;
    for (int j = 0; j < Kernel::coordinates; ++j) gradient[j] = value(stepped(x, j)).imag() / epsilon;
    return gradient;
  }

 private:
  static constexpr double epsilon = 1e-40;

  static Vector stepped(Vector x, int j) {
    x[j] += Complex(0, epsilon);
    return x;
  }

  typename Kernel::template Parameters<Complex> parameters_;
  typename Kernel::template Torque<Complex> torque_;
};

constexpr double tolerance = 2e-15;  // measured at most 4e-16 over all kernels, draws and entry points

template <class Kernel>
class KernelJacobian : public ::testing::Test {
 protected:
  static constexpr std::array<unsigned, 5> seeds = {1, 2, 3, 4, 5};
};

TYPED_TEST_SUITE(KernelJacobian, CommittedKernels, KernelName);

TYPED_TEST(KernelJacobian, OfTheResidual) {
  using Kernel = TypeParam;
  for (const unsigned seed : this->seeds) {
    const KernelInputs<Kernel> in(seed);
    const ComplexKernel<Kernel> complex(in);
    typename Kernel::template Vector<double> E, E_alone;
    typename Kernel::template Matrix<double> E_D_q, E_D_v, E_D_a, alone;
    Kernel::residual_with_jacobians(in.parameters, in.q, in.v, in.a, in.torque, E, E_D_q, E_D_v, E_D_a);
    const auto D_q =
        complex.derivative(complex.q, [&](const auto& x) { return complex.residual(x, complex.v, complex.a); });
    const auto D_v =
        complex.derivative(complex.v, [&](const auto& x) { return complex.residual(complex.q, x, complex.a); });
    const auto D_a =
        complex.derivative(complex.a, [&](const auto& x) { return complex.residual(complex.q, complex.v, x); });
    EXPECT_LT(relative_difference(E_D_q, D_q), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(E_D_v, D_v), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(E_D_a, D_a), tolerance) << "seed " << seed;

    Kernel::residual(in.parameters, in.q, in.v, in.a, in.torque, E_alone);
    EXPECT_LT(relative_difference(E_alone, E), tolerance) << "seed " << seed;
    Kernel::residual_D_q(in.parameters, in.q, in.v, in.a, in.torque, alone);
    EXPECT_LT(relative_difference(alone, E_D_q), tolerance) << "seed " << seed;
    Kernel::residual_D_v(in.parameters, in.q, in.v, in.a, in.torque, alone);
    EXPECT_LT(relative_difference(alone, E_D_v), tolerance) << "seed " << seed;
    Kernel::residual_D_a(in.parameters, in.q, in.v, in.a, in.torque, alone);
    EXPECT_LT(relative_difference(alone, E_D_a), tolerance) << "seed " << seed;
  }
}

TYPED_TEST(KernelJacobian, OfTheMomentumForm) {
  using Kernel = TypeParam;
  for (const unsigned seed : this->seeds) {
    const KernelInputs<Kernel> in(seed);
    const ComplexKernel<Kernel> complex(in);
    typename Kernel::template Vector<double> p, f, p_alone, f_alone;
    typename Kernel::template Matrix<double> p_D_q, p_D_v, f_D_q, f_D_v;
    Kernel::momentum_form_with_jacobians(in.parameters, in.q, in.v, in.torque, p, f, p_D_q, p_D_v, f_D_q, f_D_v);
    const auto p_q = complex.derivative(complex.q, [&](const auto& x) { return complex.momentum(x, complex.v); });
    const auto p_v = complex.derivative(complex.v, [&](const auto& x) { return complex.momentum(complex.q, x); });
    const auto f_q = complex.derivative(complex.q, [&](const auto& x) { return complex.force(x, complex.v); });
    const auto f_v = complex.derivative(complex.v, [&](const auto& x) { return complex.force(complex.q, x); });
    EXPECT_LT(relative_difference(p_D_q, p_q), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(p_D_v, p_v), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(f_D_q, f_q), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(f_D_v, f_v), tolerance) << "seed " << seed;

    Kernel::momentum_form(in.parameters, in.q, in.v, in.torque, p_alone, f_alone);
    EXPECT_LT(relative_difference(p_alone, p), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(f_alone, f), tolerance) << "seed " << seed;
  }
}

TYPED_TEST(KernelJacobian, OfTheGeneralizedForce) {
  using Kernel = TypeParam;
  for (const unsigned seed : this->seeds) {
    const KernelInputs<Kernel> in(seed);
    const ComplexKernel<Kernel> complex(in);
    typename Kernel::template Vector<double> Q, Q_alone;
    typename Kernel::template Matrix<double> Q_D_q, Q_D_v;
    Kernel::generalized_force_with_jacobians(in.parameters, in.q, in.v, in.torque, Q, Q_D_q, Q_D_v);
    const auto D_q =
        complex.derivative(complex.q, [&](const auto& x) { return complex.generalized_force(x, complex.v); });
    const auto D_v =
        complex.derivative(complex.v, [&](const auto& x) { return complex.generalized_force(complex.q, x); });
    EXPECT_LT(relative_difference(Q_D_q, D_q), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(Q_D_v, D_v), tolerance) << "seed " << seed;

    Kernel::generalized_force(in.parameters, in.q, in.v, in.torque, Q_alone);
    EXPECT_LT(relative_difference(Q_alone, Q), tolerance) << "seed " << seed;
  }
}

TYPED_TEST(KernelJacobian, GradientAndHessianOfTheLagrangian) {
  using Kernel = TypeParam;
  for (const unsigned seed : this->seeds) {
    const KernelInputs<Kernel> in(seed);
    const ComplexKernel<Kernel> complex(in);
    typename Kernel::template Vector<double> L_q, L_v;
    typename Kernel::template Matrix<double> L_qq, L_qv, L_vv;
    Kernel::lagrangian_gradient(in.parameters, in.q, in.v, L_q, L_v);
    Kernel::lagrangian_hessian(in.parameters, in.q, in.v, L_qq, L_qv, L_vv);
    const auto D_q = complex.gradient(complex.q, [&](const auto& x) { return complex.lagrangian(x, complex.v); });
    const auto D_v = complex.gradient(complex.v, [&](const auto& x) { return complex.lagrangian(complex.q, x); });
    const auto D_qq = complex.derivative(complex.q, [&](const auto& x) { return complex.L_q(x, complex.v); });
    const auto D_qv = complex.derivative(complex.v, [&](const auto& x) { return complex.L_q(complex.q, x); });
    const auto D_vv = complex.derivative(complex.v, [&](const auto& x) { return complex.L_v(complex.q, x); });
    EXPECT_LT(relative_difference(L_q, D_q), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(L_v, D_v), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(L_qq, D_qq), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(L_qv, D_qv), tolerance) << "seed " << seed;
    EXPECT_LT(relative_difference(L_vv, D_vv), tolerance) << "seed " << seed;
  }
}

}  // namespace
}  // namespace pendula::test
