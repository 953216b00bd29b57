#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <pendula/system/kernel_registry.hpp>
#include <random>
#include <tuple>
#include <utility>

namespace pendula {

namespace detail {

/// Takes a larger error; NaN counts as the largest, so that the check fails.
inline void keep_largest(double& largest, double error) {
  if (!std::isnan(largest) && !(error <= largest)) largest = error;
}

/// Largest entry of a − b, relative to the largest of b (or to 1 where b is small).
template <class A, class B>
double relative_error(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  if (!a.allFinite() || !b.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  return (a - b).cwiseAbs().maxCoeff() / std::max(1.0, b.cwiseAbs().maxCoeff());
}

/// Derivative of x ↦ f(x) along `direction`, by central differences of order 6.
template <class F, class Vector>
auto directional_difference(const F& f, const Vector& x, const Vector& direction) {
  // Truncation (2h)^6/140 and round-off ε/h are both near 1e-13 here.
  constexpr double h = 4e-3;
  const auto pair = [&](double steps) { return (f(x + steps * h * direction) - f(x - steps * h * direction)).eval(); };
  return ((45 * pair(1) - 9 * pair(2) + pair(3)) / (60 * h)).eval();
}

/// Relative error of ∂f/∂x given as `jacobian`, column by column against differences.
template <class F, class Vector, class Matrix>
double jacobian_error(const F& f, const Vector& x, const Matrix& jacobian) {
  Matrix differences;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    differences.col(j) = directional_difference(f, x, Vector(Vector::Unit(j)));
  }
  return relative_error(jacobian, differences);
}

/// One random chain in one random state, with what is checked there.
template <class Kernel>
class KernelDraw {
  using Vector = typename Kernel::template Vector<double>;
  using Matrix = typename Kernel::template Matrix<double>;
  using Points = typename Kernel::template Points<double>;

 public:
  explicit KernelDraw(std::mt19937& random) {
    fill(random, chain_.masses, 0.5, 2);
    fill(random, chain_.lengths, 0.5, 2);
    fill(random, chain_.damping, 0.1, 1);
    chain_.gravity = 9.81;
    fill(random, q_, 0.3, 2.8);  // away from sin θ = 0, where (θ, φ) fails
    fill(random, v_, -2, 2);
    fill(random, a_, -2, 2);
    fill(random, torque_, -1, 1);
  }

  /// ∂E/∂q, ∂E/∂v, ∂E/∂a, from their own entry points and from the one for all.
  double residual_jacobians() const {
    Vector residual;
    Matrix d_q, d_v, d_a, only_d_q, only_d_v, only_d_a;
    Kernel::residual_with_jacobians(chain_, q_, v_, a_, torque_, residual, d_q, d_v, d_a);
    Kernel::residual_D_q(chain_, q_, v_, a_, torque_, only_d_q);
    Kernel::residual_D_v(chain_, q_, v_, a_, torque_, only_d_v);
    Kernel::residual_D_a(chain_, q_, v_, a_, torque_, only_d_a);
    const auto of_q = [&](const Vector& q) { return this->residual(q, v_, a_); };
    const auto of_v = [&](const Vector& v) { return this->residual(q_, v, a_); };
    const auto of_a = [&](const Vector& a) { return this->residual(q_, v_, a); };
    return largest({jacobian_error(of_q, q_, d_q), jacobian_error(of_v, v_, d_v), jacobian_error(of_a, a_, d_a),
                    relative_error(only_d_q, d_q), relative_error(only_d_v, d_v), relative_error(only_d_a, d_a)});
  }

  /// ∂p/∂q, ∂p/∂v, ∂f/∂q, ∂f/∂v and those of the generalised force.
  double momentum_and_force_jacobians() const {
    Vector p, f, force;
    Matrix p_q, p_v, f_q, f_v, force_q, force_v;
    Kernel::momentum_form_with_jacobians(chain_, q_, v_, torque_, p, f, p_q, p_v, f_q, f_v);
    Kernel::generalized_force_with_jacobians(chain_, q_, v_, torque_, force, force_q, force_v);
    const auto of_q = [this](auto part) { return [this, part](const Vector& q) { return (this->*part)(q, v_); }; };
    const auto of_v = [this](auto part) { return [this, part](const Vector& v) { return (this->*part)(q_, v); }; };
    return largest(
        {jacobian_error(of_q(&KernelDraw::momentum), q_, p_q), jacobian_error(of_v(&KernelDraw::momentum), v_, p_v),
         jacobian_error(of_q(&KernelDraw::rate), q_, f_q), jacobian_error(of_v(&KernelDraw::rate), v_, f_v),
         jacobian_error(of_q(&KernelDraw::force), q_, force_q), jacobian_error(of_v(&KernelDraw::force), v_, force_v)});
  }

  /// ∂L/∂q, ∂L/∂v against differences of L; the Hessian against differences of those.
  double lagrangian_derivatives() const {
    Vector l_q, l_v;
    Matrix l_qq, l_qv, l_vv;
    Kernel::lagrangian_gradient(chain_, q_, v_, l_q, l_v);
    Kernel::lagrangian_hessian(chain_, q_, v_, l_qq, l_qv, l_vv);
    const auto l_of_q = [&](const Vector& q) { return this->lagrangian(q, v_); };
    const auto l_of_v = [&](const Vector& v) { return this->lagrangian(q_, v); };
    const auto gradient_of_q = [&](const Vector& q) { return this->gradient(q, v_).first; };
    const auto l_q_of_v = [&](const Vector& v) { return this->gradient(q_, v).first; };
    const auto l_v_of_v = [&](const Vector& v) { return this->gradient(q_, v).second; };
    using Row = Eigen::Matrix<double, 1, Kernel::coordinates>;
    return largest({jacobian_error(l_of_q, q_, Row(l_q.transpose())), jacobian_error(l_of_v, v_, Row(l_v.transpose())),
                    jacobian_error(gradient_of_q, q_, l_qq), jacobian_error(l_q_of_v, v_, l_qv),
                    jacobian_error(l_v_of_v, v_, l_vv)});
  }

  /// Entry points with Jacobians give the same values as those without.
  double values_with_jacobians() const {
    Vector residual, p, f, force;
    Matrix unused_1, unused_2, unused_3, unused_4;
    Kernel::residual_with_jacobians(chain_, q_, v_, a_, torque_, residual, unused_1, unused_2, unused_3);
    Kernel::momentum_form_with_jacobians(chain_, q_, v_, torque_, p, f, unused_1, unused_2, unused_3, unused_4);
    Kernel::generalized_force_with_jacobians(chain_, q_, v_, torque_, force, unused_1, unused_2);
    return largest({relative_error(residual, this->residual(q_, v_, a_)), relative_error(p, momentum(q_, v_)),
                    relative_error(f, rate(q_, v_)), relative_error(force, this->force(q_, v_))});
  }

  /// E = dp/dt − f: both forms are the same equation of motion.
  double both_forms_agree() const {
    Vector p, f;
    Matrix p_q, p_v, f_q, f_v;
    Kernel::momentum_form_with_jacobians(chain_, q_, v_, torque_, p, f, p_q, p_v, f_q, f_v);
    return relative_error(residual(q_, v_, a_), Vector(p_q * v_ + p_v * a_ - f));
  }

  /// The acceleration leaves no residual, and velocity ↦ momentum ↦ velocity is the identity.
  double solves_agree() const {
    Vector p, v, a;
    Kernel::acceleration(chain_, q_, v_, torque_, a);
    Kernel::momentum_from_velocity(chain_, q_, v_, p);
    Kernel::velocity_from_momentum(chain_, q_, p, v);
    const Vector at_rest = residual(q_, v_, Vector::Zero());  // sets the size of the terms that must cancel
    return largest({relative_error(Vector(at_rest - residual(q_, v_, a)), at_rest), relative_error(v, v_)});
  }

  /// ṙ = dr/dt, p = ∂L/∂v = A v, and H, T + U, L + 2U agree.
  double kinematics_and_energy() const {
    Points velocities;
    Matrix mass;
    double kinetic, potential, energy, lagrangian, hamiltonian;
    const Vector p = momentum(q_, v_);
    Kernel::velocities(chain_, q_, v_, velocities);
    Kernel::mass_matrix(chain_, q_, mass);
    Kernel::kinetic_energy(chain_, q_, v_, kinetic);
    Kernel::potential_energy(chain_, q_, potential);
    Kernel::energy(chain_, q_, v_, energy);
    Kernel::lagrangian(chain_, q_, v_, lagrangian);
    Kernel::hamiltonian(chain_, q_, p, hamiltonian);
    const auto positions = [&](const Vector& q) { return this->positions(q); };
    const Eigen::Vector3d energies(energy, lagrangian + 2 * potential, hamiltonian);
    return largest({relative_error(velocities, directional_difference(positions, q_, v_)),
                    relative_error(Vector(mass * v_), p),
                    relative_error(energies, Eigen::Vector3d::Constant(kinetic + potential))});
  }

 private:
  template <class Values>
  static void fill(std::mt19937& random, Values& values, double low, double high) {
    std::uniform_real_distribution<double> draw(low, high);
    for (Eigen::Index i = 0; i < values.size(); ++i) values.data()[i] = draw(random);
  }

  static double largest(std::initializer_list<double> errors) {
    double worst = 0;
    for (const double error : errors) keep_largest(worst, error);
    return worst;
  }

  Points positions(const Vector& q) const {
    Points points;
    Kernel::positions(chain_, q, points);
    return points;
  }
  Vector residual(const Vector& q, const Vector& v, const Vector& a) const {
    Vector residual;
    Kernel::residual(chain_, q, v, a, torque_, residual);
    return residual;
  }
  Vector momentum(const Vector& q, const Vector& v) const {
    Vector p, f;
    Kernel::momentum_form(chain_, q, v, torque_, p, f);
    return p;
  }
  Vector rate(const Vector& q, const Vector& v) const {
    Vector p, f;
    Kernel::momentum_form(chain_, q, v, torque_, p, f);
    return f;
  }
  Vector force(const Vector& q, const Vector& v) const {
    Vector force;
    Kernel::generalized_force(chain_, q, v, torque_, force);
    return force;
  }
  Eigen::Matrix<double, 1, 1> lagrangian(const Vector& q, const Vector& v) const {
    double value;
    Kernel::lagrangian(chain_, q, v, value);
    return Eigen::Matrix<double, 1, 1>(value);
  }
  std::pair<Vector, Vector> gradient(const Vector& q, const Vector& v) const {
    std::pair<Vector, Vector> gradient;
    Kernel::lagrangian_gradient(chain_, q, v, gradient.first, gradient.second);
    return gradient;
  }

  typename Kernel::template Parameters<double> chain_;
  typename Kernel::template Torque<double> torque_;
  Vector q_, v_, a_;
};

}  // namespace detail

/// Checks a generated kernel against itself on seeded random chains and states: each Jacobian against differences of
/// the function it belongs to, each pair of entry points that must agree. The errors measured beside the limits are the
/// largest of 2500 draws with three links in space.
template <class Kernel>
KernelCheck check_kernel(unsigned seed) {
  using Draw = detail::KernelDraw<Kernel>;
  struct Item {
    KernelCheck::Line line;
    double (Draw::*measure)() const;
  };
  const std::array<Item, std::tuple_size_v<decltype(KernelCheck::lines)>> items = {{
      {{"Jacobians of E against differences", 0, 1e-10}, &Draw::residual_jacobians},  // measured 1.4e-12
      {{"Jacobians of p, f, Q against differences", 0, 1e-10}, &Draw::momentum_and_force_jacobians},  // 1.4e-12
      {{"derivatives of L against differences", 0, 1e-10}, &Draw::lagrangian_derivatives},            // 2.6e-12
      {{"same values with and without Jacobian", 0, 1e-13}, &Draw::values_with_jacobians},            // 8.4e-16
      {{"velocity form = momentum form", 0, 1e-13}, &Draw::both_forms_agree},                         // 1.0e-15
      {{"solves for acceleration and velocity", 0, 1e-11}, &Draw::solves_agree},                      // 9.4e-15
      {{"bob velocities, momenta, energies", 0, 1e-11}, &Draw::kinematics_and_energy},                // 2.0e-13
  }};
  constexpr int draws = 5;
  std::mt19937 random(seed);
  KernelCheck check;
  for (std::size_t k = 0; k < items.size(); ++k) check.lines[k] = items[k].line;
  for (int i = 0; i < draws; ++i) {
    const Draw draw(random);
    for (std::size_t k = 0; k < items.size(); ++k) {
      detail::keep_largest(check.lines[k].error, (draw.*items[k].measure)());
    }
  }
  return check;
}

}  // namespace pendula
