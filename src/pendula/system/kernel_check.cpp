#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <numeric>
#include <pendula/system/kernel_check.hpp>
#include <pendula/system/kernel_widths.hpp>
#include <pendula/system/series_check.hpp>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

namespace pendula {
namespace {

using Numbers = std::vector<double>;

double largest_of(std::initializer_list<double> errors) {
  KernelCheck::Line worst;
  for (const double error : errors) worst.keep(error);
  return worst.error;
}

double largest_of(const Numbers& numbers) {
  double largest = 0;
  for (const double number : numbers) largest = std::max(largest, std::abs(number));
  return largest;
}

bool all_finite(const Numbers& numbers) {
  return std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); });
}

/// a + factor b.
Numbers sum(Numbers a, double factor, const Numbers& b) {
  for (std::size_t k = 0; k < a.size(); ++k) a[k] += factor * b[k];
  return a;
}

/// Matrix, stored row by row, times vector.
Numbers product(const Numbers& matrix, const Numbers& x) {
  Numbers found(matrix.size() / x.size());
  for (std::size_t k = 0; k < matrix.size(); ++k) found[k / x.size()] += matrix[k] * x[k % x.size()];
  return found;
}

/// Largest entry of a − b, relative to the largest entry of b, or to 1 if that is larger.
double relative_error(const Numbers& a, const Numbers& b) {
  if (!all_finite(a) || !all_finite(b)) return std::numeric_limits<double>::quiet_NaN();
  return largest_of(sum(a, -1, b)) / std::max(1.0, largest_of(b));
}

/// Derivative of x ↦ f(x) along `direction`, by central differences of order 6.
template <class F>
Numbers directional_difference(const F& f, const Numbers& x, const Numbers& direction) {
  // The truncation error (2h)⁶/140 and the rounding error ε/h are both near 1e-13 for this h.
  constexpr double h = 4e-3;
  Numbers found;
  for (const auto& [steps, weight] : {std::pair(1, 45.0), std::pair(2, -9.0), std::pair(3, 1.0)}) {
    const Numbers pair = sum(f(sum(x, steps * h, direction)), -1, f(sum(x, -steps * h, direction)));
    found.resize(pair.size());
    found = sum(found, weight / (60 * h), pair);
  }
  return found;
}

/// Relative error of `jacobian` = ∂f/∂x, stored row by row, against differences.
template <class F>
double jacobian_error(const F& f, const Numbers& x, const Numbers& jacobian) {
  Numbers differences(jacobian.size());
  for (std::size_t j = 0; j < x.size(); ++j) {
    Numbers unit(x.size());
    unit[j] = 1;
    const Numbers column = directional_difference(f, x, unit);
    for (std::size_t i = 0; i < column.size(); ++i) differences[i * x.size() + j] = column[i];
  }
  return relative_error(jacobian, differences);
}

/// A chain with random parameters in a random state, and the checks to be made there.
class ChainDraw {
 public:
  ChainDraw(const SystemTable& table, std::mt19937& random)
      : table_(table),
        n_(table.info.coordinates.size()),
        points_(static_cast<std::size_t>(
            std::accumulate(table.info.point_sizes.begin(), table.info.point_sizes.end(), 0))) {
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    const SystemInfo& info = table.info;
    for (std::size_t k = 0; k < info.parameters.size(); ++k) {
      const double usual = info.parameter_defaults[k];
      for (int i = 0; i < info.parameter_sizes[k]; ++i) {
        const double factor = uniform(0.5, 2);
        parameters_.push_back(std::isfinite(usual) && usual != 0 ? usual * factor
                              : info.is_positive[k]              ? factor
                                                                 : 0.1 * factor);
      }
    }
    for (std::size_t k = 0; k < n_; ++k) {
      q_.push_back(uniform(0.3, 2.8));  // away from the poles of (θ, φ)
      v_.push_back(uniform(-2, 2));
      a_.push_back(uniform(-2, 2));
    }
    for (std::size_t k = 0; k < info.inputs.size(); ++k) inputs_.push_back(uniform(-1, 1));
  }

  /// Valid as long as this object.
  KernelPoint point() const { return {0, parameters_, inputs_, q_, v_, a_}; }

  /// ∂E/∂q, ∂E/∂v, ∂E/∂a.
  double residual_jacobians() const {
    const auto [E, by_q, by_v, by_a] = residual_with_jacobians();
    return largest_of({jacobian_error([&](const Numbers& q) { return residual(q, v_, a_); }, q_, by_q),
                       jacobian_error([&](const Numbers& v) { return residual(q_, v, a_); }, v_, by_v),
                       jacobian_error([&](const Numbers& a) { return residual(q_, v_, a); }, a_, by_a)});
  }

  /// ∂p/∂q, ∂p/∂v, ∂f/∂q, ∂f/∂v.
  double momentum_jacobians() const {
    const auto [p, f, p_q, p_v, f_q, f_v] = form_with_jacobians();
    return largest_of({jacobian_error([&](const Numbers& q) { return form(q, v_)[0]; }, q_, p_q),
                       jacobian_error([&](const Numbers& v) { return form(q_, v)[0]; }, v_, p_v),
                       jacobian_error([&](const Numbers& q) { return form(q, v_)[1]; }, q_, f_q),
                       jacobian_error([&](const Numbers& v) { return form(q_, v)[1]; }, v_, f_v)});
  }

  /// Entry points that compute the same quantity give equal values.
  double same_values() const {
    const auto [p, f] = form(q_, v_);
    const auto same_form = form_with_jacobians();
    const auto [rates, forces] = call(table_.of_1.hamiltonian_form, {n_, n_}, q_, p);
    return largest_of({relative_error(residual_with_jacobians()[0], residual(q_, v_, a_)),
                       relative_error(same_form[0], p), relative_error(same_form[1], f), relative_error(rates, v_),
                       relative_error(forces, f)});
  }

  /// E = dp/dt − f: both forms are the same equation of motion.
  double both_forms_agree() const {
    const auto [p, f, p_q, p_v, f_q, f_v] = form_with_jacobians();
    return relative_error(residual(q_, v_, a_), sum(sum(product(p_q, v_), 1, product(p_v, a_)), -1, f));
  }

  /// The acceleration leaves no residual, and velocity ↦ momentum ↦ velocity is the identity.
  double solves_agree() const {
    const auto [p] = call(table_.of_1.momentum_from_velocity, {n_}, q_, v_);
    const auto [v] = call(table_.of_1.velocity_from_momentum, {n_}, q_, p);
    const Numbers at_rest = residual(q_, v_, Numbers(n_));  // sets the size of the terms that must cancel
    return largest_of(
        {relative_error(sum(at_rest, -1, residual(q_, v_, acceleration())), at_rest), relative_error(v, v_)});
  }

  /// Along the motion the energy changes by the power of the forces.
  double energy_balances() const {
    Numbers here = q_, motion = v_;
    const Numbers a = acceleration();
    here.insert(here.end(), v_.begin(), v_.end());
    motion.insert(motion.end(), a.begin(), a.end());
    const auto energy = [&](const Numbers& x) {
      const Numbers q(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(n_));
      const Numbers v(x.begin() + static_cast<std::ptrdiff_t>(n_), x.end());
      return call(table_.of_1.energies, {1, 1}, q, v)[1];
    };
    return relative_error(directional_difference(energy, here, motion), call(table_.of_1.power, {1}, q_, v_)[0]);
  }

  /// Velocities of the bobs are the derivatives of their positions.
  double points_move() const {
    const auto positions = [&](const Numbers& q) { return call(table_.plain.positions, {points_}, q)[0]; };
    return relative_error(call(table_.plain.velocities, {points_}, q_, v_)[0],
                          directional_difference(positions, q_, v_));
  }

  /// The functions that return one Jacobian only: ∂E/∂q, ∂E/∂v, ∂E/∂a; and ∂Q/∂q, ∂Q/∂v.
  double single_jacobians() const {
    const auto [E, E_q, E_v, E_a] = residual_with_jacobians();
    const auto [only_q] = call(table_.chain->residual_D_q, {n_ * n_}, q_, v_, a_);
    const auto [only_v] = call(table_.chain->residual_D_v, {n_ * n_}, q_, v_, a_);
    const auto [only_a] = call(table_.chain->residual_D_a, {n_ * n_}, q_, v_, a_);
    const auto [Q, by_q, by_v] = call(table_.chain->force_with_jacobians, {n_, n_ * n_, n_ * n_}, q_, v_);
    return largest_of({relative_error(only_q, E_q), relative_error(only_v, E_v), relative_error(only_a, E_a),
                       relative_error(Q, force(q_, v_)),
                       jacobian_error([&](const Numbers& q) { return force(q, v_); }, q_, by_q),
                       jacobian_error([&](const Numbers& v) { return force(q_, v); }, v_, by_v)});
  }

  /// ∂L/∂q and ∂L/∂v against differences of L, the Hessian against differences of the gradient.
  double lagrangian_derivatives() const {
    const auto lagrangian = [&](const Numbers& q, const Numbers& v) {
      return call(table_.chain->lagrangian, {1}, q, v)[0];
    };
    const auto gradient = [&](const Numbers& q, const Numbers& v) {
      return call(table_.chain->lagrangian_gradient, {n_, n_}, q, v);
    };
    const auto [by_q, by_v] = gradient(q_, v_);
    const auto [qq, qv, vv] = call(table_.chain->lagrangian_hessian, {n_ * n_, n_ * n_, n_ * n_}, q_, v_);
    return largest_of({jacobian_error([&](const Numbers& q) { return lagrangian(q, v_); }, q_, by_q),
                       jacobian_error([&](const Numbers& v) { return lagrangian(q_, v); }, v_, by_v),
                       jacobian_error([&](const Numbers& q) { return gradient(q, v_)[0]; }, q_, qq),
                       jacobian_error([&](const Numbers& v) { return gradient(q_, v)[0]; }, v_, qv),
                       jacobian_error([&](const Numbers& v) { return gradient(q_, v)[1]; }, v_, vv)});
  }

  /// p = ∂L/∂v = A v, and H = T + U = L + 2U.
  double energies() const {
    const Numbers p = form(q_, v_)[0];
    const auto [mass] = call(table_.of_1.mass_matrix, {n_ * n_}, q_);
    const auto [kinetic, total] = call(table_.of_1.energies, {1, 1}, q_, v_);
    const auto [potential] = call(table_.chain->potential_energy, {1}, q_);
    const auto [lagrangian] = call(table_.chain->lagrangian, {1}, q_, v_);
    const auto [hamiltonian] = call(table_.chain->hamiltonian, {1}, q_, p);
    const Numbers expected(3, kinetic[0] + potential[0]);
    return largest_of({relative_error(product(mass, v_), p),
                       relative_error({total[0], lagrangian[0] + 2 * potential[0], hamiltonian[0]}, expected)});
  }

 private:
  // Calls a function with outputs of these sizes, and returns the outputs.
  template <std::size_t outputs, class Function, class... Given>
  std::array<Numbers, outputs> call(Function* function, const std::size_t (&sizes)[outputs],
                                    const Given&... given) const {
    const double time = 0;
    std::array<Numbers, outputs> found;
    for (std::size_t k = 0; k < outputs; ++k) found[k].resize(sizes[k]);
    const Conditions at{table_.context, parameters_.data(), &time, inputs_.data()};
    std::apply([&](auto&... to) { function(at, given.data()..., to.data()...); }, found);
    return found;
  }

  Numbers residual(const Numbers& q, const Numbers& v, const Numbers& a) const {
    return call(table_.plain.residual, {n_}, q, v, a)[0];
  }
  std::array<Numbers, 4> residual_with_jacobians() const {
    return call(table_.of_1.residual_with_jacobians, {n_, n_ * n_, n_ * n_, n_ * n_}, q_, v_, a_);
  }
  std::array<Numbers, 2> form(const Numbers& q, const Numbers& v) const {
    return call(table_.of_1.momentum_form, {n_, n_}, q, v);
  }
  std::array<Numbers, 6> form_with_jacobians() const {
    return call(table_.of_1.momentum_form_with_jacobians, {n_, n_, n_ * n_, n_ * n_, n_ * n_, n_ * n_}, q_, v_);
  }
  Numbers acceleration() const { return call(table_.of_1.acceleration, {n_}, q_, v_)[0]; }
  Numbers force(const Numbers& q, const Numbers& v) const { return call(table_.chain->force, {n_}, q, v)[0]; }

  const SystemTable& table_;
  std::size_t n_, points_;
  Numbers parameters_, inputs_, q_, v_, a_;
};

/// One statement about a kernel, and the function that measures its error.
struct CheckItem {
  KernelCheck::Line line;
  double (ChainDraw::*measure)() const;
};

// Beside the limits stands the largest error of the committed kernels.
constexpr std::array<CheckItem, 10> items{{
    {{"Jacobians of E against differences", 0, 1e-10}, &ChainDraw::residual_jacobians},        // 3.0e-12
    {{"Jacobians of p, f against differences", 0, 1e-10}, &ChainDraw::momentum_jacobians},     // 4.7e-12
    {{"Jacobians of E and Q, one by one", 0, 1e-11}, &ChainDraw::single_jacobians},            // 5.5e-14
    {{"derivatives of L against differences", 0, 1e-10}, &ChainDraw::lagrangian_derivatives},  // 2.3e-12
    {{"same values from all entry points", 0, 1e-13}, &ChainDraw::same_values},                // 1.9e-15
    {{"velocity form = momentum form", 0, 1e-13}, &ChainDraw::both_forms_agree},               // 4.7e-16
    {{"solves for acceleration and velocity", 0, 1e-11}, &ChainDraw::solves_agree},            // 1.4e-15
    {{"energy changes by the power", 0, 1e-8}, &ChainDraw::energy_balances},                   // 3.7e-10
    {{"velocities of bobs", 0, 1e-11}, &ChainDraw::points_move},                               // 6.1e-14
    {{"momenta and energies", 0, 1e-11}, &ChainDraw::energies},                                // 1.2e-15
}};

}  // namespace

KernelCheck check_chain_kernel(const SystemTable& table, unsigned seed) {
  constexpr int draws = 5;
  KernelCheck check;
  for (std::size_t k = 0; k < items.size(); ++k) check.lines[k] = items[k].line;
  std::mt19937 random(seed);
  std::vector<ChainDraw> drawn;
  std::vector<KernelPoint> points;
  drawn.reserve(draws);
  for (int i = 0; i < draws; ++i) drawn.emplace_back(table, random);
  for (const ChainDraw& draw : drawn) {
    points.push_back(draw.point());
    for (std::size_t k = 0; k < items.size(); ++k) check.lines[k].keep((draw.*items[k].measure)());
  }
  check.lines[items.size()] = {width_line, width_error(table, points), 1e-13};  // 5.5e-16
  check.count = static_cast<int>(items.size()) + 1;
  if (table.of_1.series_next != nullptr) {
    check.lines[items.size() + 1] = {series_line, series_error(table, points), 1e-6};  // 2.5e-15
    ++check.count;
  }
  return check;
}

}  // namespace pendula
