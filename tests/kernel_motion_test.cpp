// All forms of a generated kernel's equations of motion are the same one, and its energy changes by the power that it
// tells: with the parameters and in the states that `pendula check` draws.

#include <cmath>
#include <pendula/system/kernel_checks.hpp>
#include <pendula/system/plain_system.hpp>
#include <vector>

#include "support/kernels.hpp"

namespace pendula::test {
namespace {

/// A draw, as the functions of a kernel take it.
template <class Kernel>
struct DrawnInputs {
  using Vector = typename Kernel::template Vector<double>;
  using Torque = typename Kernel::template Torque<double>;

  typename Kernel::template Parameters<double> parameters;
  Torque torque;
  Vector q, v, a;

  explicit DrawnInputs(const KernelPoint& point)
      : torque(Eigen::Map<const Torque>(point.inputs.data())),
        q(Eigen::Map<const Vector>(point.q.data())),
        v(Eigen::Map<const Vector>(point.v.data())),
        a(Eigen::Map<const Vector>(point.a.data())) {
    Kernel::template read_parameters<double>(point.parameters, parameters);
  }
};

template <class Kernel>
class KernelMotion : public ::testing::Test {
 protected:
  const std::vector<KernelPoint> points = random_points(info_of<Kernel>(), 1);
};

TYPED_TEST_SUITE(KernelMotion, CommittedKernels, KernelName);

TYPED_TEST(KernelMotion, IsThatOfMomenta) {
  using Kernel = TypeParam;
  for (const KernelPoint& point : this->points) {
    const DrawnInputs<Kernel> in(point);
    typename Kernel::template Vector<double> p, f, v, f_of_p;
    Kernel::momentum_form(in.parameters, in.q, in.v, in.torque, p, f);
    Kernel::hamiltonian_form(in.parameters, in.q, p, in.torque, v, f_of_p);
    EXPECT_LT(relative_difference(v, in.v), 1e-13);    // measured at most 1.9e-15
    EXPECT_LT(relative_difference(f_of_p, f), 1e-13);  // measured at most 1.9e-15
  }
}

TYPED_TEST(KernelMotion, IsThatOfTheResidual) {
  using Kernel = TypeParam;
  for (const KernelPoint& point : this->points) {
    const DrawnInputs<Kernel> in(point);
    typename Kernel::template Vector<double> E, p, f;
    typename Kernel::template Matrix<double> p_D_q, p_D_v, f_D_q, f_D_v;
    Kernel::momentum_form_with_jacobians(in.parameters, in.q, in.v, in.torque, p, f, p_D_q, p_D_v, f_D_q, f_D_v);
    Kernel::residual(in.parameters, in.q, in.v, in.a, in.torque, E);
    EXPECT_LT(relative_difference(E, p_D_q * in.v + p_D_v * in.a - f), 1e-13) << "E = dp/dt − f";  // measured 4.7e-16
  }
}

/// df/dt at t = 0, by central differences of order 6.
template <class F>
double slope(const F& f) {
  // The truncation error (2h)⁶/140 and the rounding error ε/h are both near 1e-13 for this h.
  constexpr double h = 4e-3;
  const auto difference = [&](double t) { return f(t) - f(-t); };
  return (45 * difference(h) - 9 * difference(2 * h) + difference(3 * h)) / (60 * h);
}

TYPED_TEST(KernelMotion, ChangesTheEnergyByThePower) {
  using Kernel = TypeParam;
  using Vector = typename Kernel::template Vector<double>;
  for (const KernelPoint& point : this->points) {
    const DrawnInputs<Kernel> in(point);
    Vector a;
    double power;
    Kernel::acceleration(in.parameters, in.q, in.v, in.torque, a);
    Kernel::power(in.parameters, in.q, in.v, in.torque, power);
    const auto energy = [&](double t) {
      double E;
      Kernel::energy(in.parameters, Vector(in.q + t * in.v), Vector(in.v + t * a), E);
      return E;
    };
    EXPECT_NEAR(slope(energy), power, 1e-8 * std::max(1.0, std::abs(power)));  // measured 3.7e-10
  }
}

}  // namespace
}  // namespace pendula::test
