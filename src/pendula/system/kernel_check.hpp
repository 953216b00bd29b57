#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <pendula/system/kernel_registry.hpp>
#include <pendula/system/system_model.hpp>
#include <random>
#include <utility>

namespace pendula {

namespace detail {

/// Takes a larger error; NaN counts as the largest, so that the check fails.
inline void keep_largest(double& largest, double error) {
  if (!std::isnan(largest) && !(error <= largest)) largest = error;
}

inline double largest_of(std::initializer_list<double> errors) {
  double worst = 0;
  for (const double error : errors) keep_largest(worst, error);
  return worst;
}

/// Largest entry of a − b, relative to the largest of b (or to 1 where b is small).
template <class A, class B>
double relative_error(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  if (a.size() == 0) return 0;
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

/// A chain with random parameters in a random state, and what is checked there.
template <System S>
class ChainDraw {
 public:
  using Vector = typename S::template Vector<double>;
  using Matrix = typename S::template Matrix<double>;
  using Number = Eigen::Matrix<double, 1, 1>;

  explicit ChainDraw(std::mt19937& random) {
    draw_parameters(random);
    for (Eigen::Index k = 0; k < q_.size(); ++k) {
      q_[k] = uniform(random, 0.3, 2.8);  // away from where (θ, φ) fails
      v_[k] = uniform(random, -2, 2);
      a_[k] = uniform(random, -2, 2);
    }
    for (Eigen::Index i = 0; i < inputs_.size(); ++i) inputs_.data()[i] = uniform(random, -1, 1);
  }

  /// ∂E/∂q, ∂E/∂v, ∂E/∂a.
  double residual_jacobians() const {
    Vector residual;
    Matrix d_q, d_v, d_a;
    S::residual_with_jacobians(parameters_, q_, v_, a_, inputs_, residual, d_q, d_v, d_a);
    const auto of_q = [&](const Vector& q) { return this->residual(q, v_, a_); };
    const auto of_v = [&](const Vector& v) { return this->residual(q_, v, a_); };
    const auto of_a = [&](const Vector& a) { return this->residual(q_, v_, a); };
    return largest_of({jacobian_error(of_q, q_, d_q), jacobian_error(of_v, v_, d_v), jacobian_error(of_a, a_, d_a)});
  }

  /// ∂p/∂q, ∂p/∂v, ∂f/∂q, ∂f/∂v.
  double momentum_jacobians() const {
    Vector p, f;
    Matrix p_q, p_v, f_q, f_v;
    S::momentum_form_with_jacobians(parameters_, q_, v_, inputs_, p, f, p_q, p_v, f_q, f_v);
    const auto p_of_q = [&](const Vector& q) { return form(q, v_).first; };
    const auto p_of_v = [&](const Vector& v) { return form(q_, v).first; };
    const auto f_of_q = [&](const Vector& q) { return form(q, v_).second; };
    const auto f_of_v = [&](const Vector& v) { return form(q_, v).second; };
    return largest_of({jacobian_error(p_of_q, q_, p_q), jacobian_error(p_of_v, v_, p_v),
                       jacobian_error(f_of_q, q_, f_q), jacobian_error(f_of_v, v_, f_v)});
  }

  /// Entry points that give the same values give the same values.
  double same_values() const {
    Vector residual, p, f, v, force;
    Matrix unused_1, unused_2, unused_3, unused_4;
    S::residual_with_jacobians(parameters_, q_, v_, a_, inputs_, residual, unused_1, unused_2, unused_3);
    S::momentum_form_with_jacobians(parameters_, q_, v_, inputs_, p, f, unused_1, unused_2, unused_3, unused_4);
    const auto [momentum, rate] = form(q_, v_);
    S::hamiltonian_form(parameters_, q_, momentum, inputs_, v, force);
    return largest_of({relative_error(residual, this->residual(q_, v_, a_)), relative_error(p, momentum),
                       relative_error(f, rate), relative_error(v, v_), relative_error(force, rate)});
  }

  /// E = dp/dt − f: both forms are the same equation of motion.
  double both_forms_agree() const {
    Vector p, f;
    Matrix p_q, p_v, f_q, f_v;
    S::momentum_form_with_jacobians(parameters_, q_, v_, inputs_, p, f, p_q, p_v, f_q, f_v);
    return relative_error(this->residual(q_, v_, a_), Vector(p_q * v_ + p_v * a_ - f));
  }

  /// The acceleration leaves no residual, and velocity ↦ momentum ↦ velocity is the identity.
  double solves_agree() const {
    Vector p, v, a;
    S::acceleration(parameters_, q_, v_, inputs_, a);
    S::momentum_from_velocity(parameters_, q_, v_, p);
    S::velocity_from_momentum(parameters_, q_, p, v);
    const Vector at_rest = this->residual(q_, v_, Vector::Zero());  // sets the size of the terms that must cancel
    return largest_of({relative_error(Vector(at_rest - this->residual(q_, v_, a)), at_rest), relative_error(v, v_)});
  }

  /// Along the motion energy changes by the power of forces.
  double energy_balances() const {
    Vector a;
    double power = 0;
    S::acceleration(parameters_, q_, v_, inputs_, a);
    S::power(parameters_, q_, v_, inputs_, power);
    using Along = Eigen::Matrix<double, 2 * S::coordinates, 1>;
    Along here, motion;
    here << q_, v_;
    motion << v_, a;
    const auto energy = [&](const Along& x) {
      double value = 0;
      S::energy(parameters_, Vector(x.template head<S::coordinates>()), Vector(x.template tail<S::coordinates>()),
                value);
      return Number(value);
    };
    return relative_error(directional_difference(energy, here, motion), Number(power));
  }

  /// Velocities of the bobs are derivatives of their positions.
  double points_move() const {
    using Points = typename S::template Points<double>;
    Points velocities;
    S::velocities(parameters_, q_, v_, velocities);
    const auto positions = [&](const Vector& q) {
      Points points;
      S::positions(parameters_, q, points);
      return points;
    };
    return relative_error(velocities, directional_difference(positions, q_, v_));
  }

  /// ∂E/∂q, ∂E/∂v, ∂E/∂a alone; ∂Q/∂q, ∂Q/∂v.
  double single_jacobians() const {
    Vector residual, force;
    Matrix d_q, d_v, d_a, only_d_q, only_d_v, only_d_a, force_q, force_v;
    S::residual_with_jacobians(parameters_, q_, v_, a_, inputs_, residual, d_q, d_v, d_a);
    S::residual_D_q(parameters_, q_, v_, a_, inputs_, only_d_q);
    S::residual_D_v(parameters_, q_, v_, a_, inputs_, only_d_v);
    S::residual_D_a(parameters_, q_, v_, a_, inputs_, only_d_a);
    S::generalized_force_with_jacobians(parameters_, q_, v_, inputs_, force, force_q, force_v);
    const auto of_q = [&](const Vector& q) { return this->force(q, v_); };
    const auto of_v = [&](const Vector& v) { return this->force(q_, v); };
    return largest_of({relative_error(only_d_q, d_q), relative_error(only_d_v, d_v), relative_error(only_d_a, d_a),
                       relative_error(force, this->force(q_, v_)), jacobian_error(of_q, q_, force_q),
                       jacobian_error(of_v, v_, force_v)});
  }

  /// ∂L/∂q, ∂L/∂v against differences of L; the Hessian against differences of those.
  double lagrangian_derivatives() const {
    Vector l_q, l_v;
    Matrix l_qq, l_qv, l_vv;
    S::lagrangian_gradient(parameters_, q_, v_, l_q, l_v);
    S::lagrangian_hessian(parameters_, q_, v_, l_qq, l_qv, l_vv);
    const auto l_of_q = [&](const Vector& q) { return this->lagrangian(q, v_); };
    const auto l_of_v = [&](const Vector& v) { return this->lagrangian(q_, v); };
    const auto gradient_of_q = [&](const Vector& q) { return this->gradient(q, v_).first; };
    const auto l_q_of_v = [&](const Vector& v) { return this->gradient(q_, v).first; };
    const auto l_v_of_v = [&](const Vector& v) { return this->gradient(q_, v).second; };
    using Row = Eigen::Matrix<double, 1, S::coordinates>;
    return largest_of({jacobian_error(l_of_q, q_, Row(l_q.transpose())),
                       jacobian_error(l_of_v, v_, Row(l_v.transpose())), jacobian_error(gradient_of_q, q_, l_qq),
                       jacobian_error(l_q_of_v, v_, l_qv), jacobian_error(l_v_of_v, v_, l_vv)});
  }

  /// p = ∂L/∂v = A v, and H, T + U, L + 2U agree.
  double energies() const {
    Matrix mass;
    double kinetic = 0, potential = 0, energy = 0, lagrangian = 0, hamiltonian = 0;
    const Vector p = form(q_, v_).first;
    S::mass_matrix(parameters_, q_, mass);
    S::kinetic_energy(parameters_, q_, v_, kinetic);
    S::potential_energy(parameters_, q_, potential);
    S::energy(parameters_, q_, v_, energy);
    S::lagrangian(parameters_, q_, v_, lagrangian);
    S::hamiltonian(parameters_, q_, p, hamiltonian);
    const Eigen::Vector3d energies(energy, lagrangian + 2 * potential, hamiltonian);
    return largest_of({relative_error(Vector(mass * v_), p),
                       relative_error(energies, Eigen::Vector3d::Constant(kinetic + potential))});
  }

 private:
  using Parameters = typename S::template Parameters<double>;

  static double uniform(std::mt19937& random, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }

  void draw_parameters(std::mt19937& random) {
    std::array<double, static_cast<std::size_t>(parameter_count<S>())> numbers{};
    std::size_t at = 0;
    for (std::size_t k = 0; k < S::parameter_names.size(); ++k) {
      const double usual = S::parameter_defaults[k];
      for (int i = 0; i < S::parameter_sizes[k]; ++i) {
        const double factor = uniform(random, 0.5, 2);
        numbers[at++] = std::isfinite(usual) && usual != 0 ? usual * factor
                        : S::parameter_is_positive[k]      ? factor
                                                           : 0.1 * factor;
      }
    }
    S::template read_parameters<double>(numbers.data(), parameters_);
  }

  Vector residual(const Vector& q, const Vector& v, const Vector& a) const {
    Vector residual;
    S::residual(parameters_, q, v, a, inputs_, residual);
    return residual;
  }
  std::pair<Vector, Vector> form(const Vector& q, const Vector& v) const {
    std::pair<Vector, Vector> form;
    S::momentum_form(parameters_, q, v, inputs_, form.first, form.second);
    return form;
  }
  Vector force(const Vector& q, const Vector& v) const {
    Vector force;
    S::generalized_force(parameters_, q, v, inputs_, force);
    return force;
  }
  Number lagrangian(const Vector& q, const Vector& v) const {
    double value = 0;
    S::lagrangian(parameters_, q, v, value);
    return Number(value);
  }
  std::pair<Vector, Vector> gradient(const Vector& q, const Vector& v) const {
    std::pair<Vector, Vector> gradient;
    S::lagrangian_gradient(parameters_, q, v, gradient.first, gradient.second);
    return gradient;
  }

  Parameters parameters_{};
  typename S::template Inputs<double> inputs_;
  Vector q_, v_, a_;
};

/// One statement, and what measures it on a draw.
template <System S>
struct CheckItem {
  KernelCheck::Line line;
  double (ChainDraw<S>::*measure)() const;
};

}  // namespace detail

/// Checks the generated kernel of a chain against itself with seeded random parameters in random states: each Jacobian
/// against differences of the function it belongs to, each pair of entry points that must agree.
template <System S>
KernelCheck check_chain_kernel(unsigned seed) {
  using Draw = detail::ChainDraw<S>;
  // Beside the limits stands the largest error of the committed kernels.
  constexpr std::array<detail::CheckItem<S>, 10> items{{
      {{"Jacobians of E against differences", 0, 1e-10}, &Draw::residual_jacobians},        // 3.0e-12
      {{"Jacobians of p, f against differences", 0, 1e-10}, &Draw::momentum_jacobians},     // 4.7e-12
      {{"Jacobians of E and Q, one by one", 0, 1e-11}, &Draw::single_jacobians},            // 5.5e-14
      {{"derivatives of L against differences", 0, 1e-10}, &Draw::lagrangian_derivatives},  // 2.3e-12
      {{"same values from all entry points", 0, 1e-13}, &Draw::same_values},                // 1.9e-15
      {{"velocity form = momentum form", 0, 1e-13}, &Draw::both_forms_agree},               // 4.7e-16
      {{"solves for acceleration and velocity", 0, 1e-11}, &Draw::solves_agree},            // 1.4e-15
      {{"energy changes by the power", 0, 1e-8}, &Draw::energy_balances},                   // 3.7e-10
      {{"velocities of bobs", 0, 1e-11}, &Draw::points_move},                               // 6.1e-14
      {{"momenta and energies", 0, 1e-11}, &Draw::energies},                                // 1.2e-15
  }};
  constexpr int draws = 5;
  KernelCheck check;
  check.count = static_cast<int>(items.size());
  for (std::size_t k = 0; k < items.size(); ++k) check.lines[k] = items[k].line;
  std::mt19937 random(seed);
  for (int i = 0; i < draws; ++i) {
    const Draw draw(random);
    for (std::size_t k = 0; k < items.size(); ++k) {
      detail::keep_largest(check.lines[k].error, (draw.*items[k].measure)());
    }
  }
  return check;
}

}  // namespace pendula
