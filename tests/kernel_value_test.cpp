// What the generated kernels say agrees with itself, with the O(n) invariants, and in every number type.

#include <pendula/chain/invariants.hpp>
#include <unsupported/Eigen/AutoDiff>
#include <xsimd/xsimd.hpp>

#include "support/kernels.hpp"

namespace pendula::test {
namespace {

template <class Kernel>
class KernelValue : public ::testing::Test {};

TYPED_TEST_SUITE(KernelValue, CommittedKernels, KernelName);

template <class Kernel>
State<SpaceOf<Kernel>> state_of(const KernelInputs<Kernel>& in) {
  return {0, in.q, in.v};
}

TYPED_TEST(KernelValue, BobsAreWhereTheLinkDirectionsPutThem) {
  using Kernel = TypeParam;
  const KernelInputs<Kernel> in(1);
  typename Kernel::template Points<double> points;
  Kernel::positions(in.parameters, in.q, points);
  EXPECT_LT((points - bob_positions(in.chain, state_of(in))).cwiseAbs().maxCoeff(), 3e-15);  // measured 2e-16
  Kernel::velocities(in.parameters, in.q, in.v, points);
  EXPECT_LT((points - bob_velocities(in.chain, state_of(in))).cwiseAbs().maxCoeff(), 3e-15);  // measured 2e-16
}

TYPED_TEST(KernelValue, EnergiesAgree) {
  using Kernel = TypeParam;
  const KernelInputs<Kernel> in(2);
  double T, U, E, L, H;
  typename Kernel::template Vector<double> p;
  Kernel::kinetic_energy(in.parameters, in.q, in.v, T);
  Kernel::potential_energy(in.parameters, in.q, U);
  Kernel::energy(in.parameters, in.q, in.v, E);
  Kernel::lagrangian(in.parameters, in.q, in.v, L);
  Kernel::momentum_from_velocity(in.parameters, in.q, in.v, p);
  Kernel::hamiltonian(in.parameters, in.q, p, H);
  const double scale = energy_scale(in.chain);
  EXPECT_NEAR(E, T + U, 1e-15 * scale);                             // measured 4e-15 J in 100 J
  EXPECT_NEAR(L, T - U, 1e-15 * scale);                             // measured 4e-15 J
  EXPECT_NEAR(H, E, 1e-15 * scale);                                 // measured 0
  EXPECT_NEAR(E, energy(in.chain, state_of(in)), 1e-15 * scale);    // measured 4e-15 J
  EXPECT_NEAR(p.dot(in.v) - L, H, 1e-15 * scale) << "H = p·v − L";  // measured 4e-15 J
}

TYPED_TEST(KernelValue, MomentumAndVelocityAreInverses) {
  using Kernel = TypeParam;
  const KernelInputs<Kernel> in(3);
  typename Kernel::template Vector<double> p, v, p_form, f, L_q, L_v, Q;
  typename Kernel::template Matrix<double> mass_matrix;
  Kernel::momentum_from_velocity(in.parameters, in.q, in.v, p);
  Kernel::velocity_from_momentum(in.parameters, in.q, p, v);
  EXPECT_LT((v - in.v).cwiseAbs().maxCoeff(), 2e-14);  // measured 2e-15
  Kernel::mass_matrix(in.parameters, in.q, mass_matrix);
  EXPECT_LT((mass_matrix * in.v - p).cwiseAbs().maxCoeff(), 1e-14);  // measured 9e-16
  Kernel::momentum_form(in.parameters, in.q, in.v, in.torque, p_form, f);
  Kernel::lagrangian_gradient(in.parameters, in.q, in.v, L_q, L_v);
  Kernel::generalized_force(in.parameters, in.q, in.v, in.torque, Q);
  EXPECT_LT((p_form - p).cwiseAbs().maxCoeff(), 1e-14);     // measured 9e-16
  EXPECT_LT((L_v - p).cwiseAbs().maxCoeff(), 1e-14);        // measured 9e-16
  EXPECT_LT((f - (L_q + Q)).cwiseAbs().maxCoeff(), 1e-13);  // measured 7e-15
}

TYPED_TEST(KernelValue, AccelerationZeroesTheResidual) {
  using Kernel = TypeParam;
  const KernelInputs<Kernel> in(4);
  typename Kernel::template Vector<double> a, residual;
  Kernel::acceleration(in.parameters, in.q, in.v, in.torque, a);
  Kernel::residual(in.parameters, in.q, in.v, a, in.torque, residual);
  EXPECT_LT(residual.cwiseAbs().maxCoeff(), 2e-13);  // measured 1.4e-14
}

template <class Kernel>
typename Kernel::template Vector<double> residual_from_blocks(const KernelInputs<Kernel>& in) {
  using LinkMatrix = typename Kernel::template LinkMatrix<double>;
  using LinkVector = typename Kernel::template LinkVector<double>;
  typename Kernel::template Vector<double> E, Q;
  constexpr int n = Kernel::links;
  if constexpr (Kernel::dof == 1) {
    LinkMatrix C, S;
    LinkVector h;
    Kernel::block_C(in.parameters, in.q, C);
    Kernel::block_S(in.parameters, in.q, S);
    Kernel::block_h(in.parameters, in.q, h);
    E = C * in.a - S * in.v.cwiseAbs2() + h;
  } else {
    LinkMatrix A11, A12, A21, A22, B11, B12, B21, B22, C1, C2;
    LinkVector g;
    Kernel::block_A11(in.parameters, in.q, A11);
    Kernel::block_A12(in.parameters, in.q, A12);
    Kernel::block_A21(in.parameters, in.q, A21);
    Kernel::block_A22(in.parameters, in.q, A22);
    Kernel::block_B11(in.parameters, in.q, B11);
    Kernel::block_B12(in.parameters, in.q, B12);
    Kernel::block_B21(in.parameters, in.q, B21);
    Kernel::block_B22(in.parameters, in.q, B22);
    Kernel::block_C1(in.parameters, in.q, C1);
    Kernel::block_C2(in.parameters, in.q, C2);
    Kernel::block_g(in.parameters, in.q, g);
    const LinkVector theta_dot2 = in.v.template head<n>().cwiseAbs2(), phi_dot2 = in.v.template tail<n>().cwiseAbs2();
    const LinkVector product = in.v.template head<n>().cwiseProduct(in.v.template tail<n>());
    E.template head<n>() = A11 * in.a.template head<n>() + A12 * in.a.template tail<n>() - B11 * theta_dot2 -
                           B12 * phi_dot2 + C1 * product + g;
    E.template tail<n>() = A21 * in.a.template head<n>() + A22 * in.a.template tail<n>() - B21 * theta_dot2 -
                           B22 * phi_dot2 + C2 * product;
  }
  Kernel::generalized_force(in.parameters, in.q, in.v, in.torque, Q);
  return E - Q;
}

TYPED_TEST(KernelValue, BlocksMakeTheResidual) {
  using Kernel = TypeParam;
  const KernelInputs<Kernel> in(5);
  typename Kernel::template Vector<double> residual;
  Kernel::residual(in.parameters, in.q, in.v, in.a, in.torque, residual);
  EXPECT_LT((residual - residual_from_blocks<Kernel>(in)).cwiseAbs().maxCoeff(), 2e-13);  // measured 1.1e-14
}

TYPED_TEST(KernelValue, LoadsDoTheWorkTheyShould) {
  using Kernel = TypeParam;
  KernelInputs<Kernel> in(6);
  typename Kernel::template Vector<double> Q;
  in.torque.setZero();
  Kernel::generalized_force(in.parameters, in.q, in.v, in.torque, Q);
  const double scale = dissipation(in.chain, state_of(in));
  EXPECT_NEAR(Q.dot(in.v), -scale, 1e-15 * (1 + scale)) << "damping takes out Σ λ |û̇|²";  // measured 6e-17
}

template <class Real, class Kernel>
typename Kernel::template Vector<Real> residual_in(const KernelInputs<Kernel>& in) {
  using Vector = typename Kernel::template Vector<Real>;
  Vector residual;
  Kernel::residual(parameters_as<Kernel, Real>(in.parameters), matrix_as<Vector>(in.q), matrix_as<Vector>(in.v),
                   matrix_as<Vector>(in.a), matrix_as<typename Kernel::template Torque<Real>>(in.torque), residual);
  return residual;
}

TYPED_TEST(KernelValue, FloatIsDoubleRounded) {
  using Kernel = TypeParam;
  const KernelInputs<Kernel> in(7);
  const auto expected = residual_in<double>(in);
  const auto got = residual_in<float>(in);
  EXPECT_LT((got.template cast<double>() - expected).cwiseAbs().maxCoeff(),
            1e-6 * expected.cwiseAbs().maxCoeff());  // measured 4e-6 in 40
}

TYPED_TEST(KernelValue, EveryLaneOfABatchIsADouble) {
  using Kernel = TypeParam;
  using Batch = xsimd::batch<double>;
  const KernelInputs<Kernel> in(8);
  const auto expected = residual_in<double>(in);
  const auto got = residual_in<Batch>(in);
  for (int i = 0; i < Kernel::coordinates; ++i) {
    for (std::size_t lane = 0; lane < Batch::size; ++lane) {
      EXPECT_NEAR(got[i].get(lane), expected[i], 1e-15 * expected.cwiseAbs().maxCoeff());  // measured 7e-15 in 40
    }
  }
}

// Dual numbers through the same text; one kernel a space keeps the compile time down, complex step covers the others.
template <class Kernel>
class KernelDual : public ::testing::Test {};
using DualKernels = ::testing::Types<kernels::Planar2, kernels::Spatial1>;
TYPED_TEST_SUITE(KernelDual, DualKernels, KernelName);

TYPED_TEST(KernelDual, GivesTheJacobian) {
  using Kernel = TypeParam;
  using Dual = Eigen::AutoDiffScalar<typename Kernel::template Vector<double>>;
  using DualVector = typename Kernel::template Vector<Dual>;
  const KernelInputs<Kernel> in(9);
  auto q = matrix_as<DualVector>(in.q);
  for (int i = 0; i < Kernel::coordinates; ++i) q[i].derivatives() = Kernel::template Vector<double>::Unit(i);
  auto v = matrix_as<DualVector>(in.v), a = matrix_as<DualVector>(in.a);
  for (int i = 0; i < Kernel::coordinates; ++i) v[i].derivatives().setZero(), a[i].derivatives().setZero();
  DualVector residual;
  Kernel::residual(parameters_as<Kernel, Dual>(in.parameters), q, v, a,
                   matrix_as<typename Kernel::template Torque<Dual>>(in.torque), residual);
  typename Kernel::template Matrix<double> E_D_q;
  Kernel::residual_D_q(in.parameters, in.q, in.v, in.a, in.torque, E_D_q);
  for (int i = 0; i < Kernel::coordinates; ++i) {
    EXPECT_LT((residual[i].derivatives().transpose() - E_D_q.row(i)).cwiseAbs().maxCoeff(), 1e-14);  // measured 2e-16
  }
}

}  // namespace
}  // namespace pendula::test
