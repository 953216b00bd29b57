#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <problems.hpp>
#include <xsimd/xsimd.hpp>

namespace bench {

/// The equations a user of a general solver would write: y = (θ, θ̇), the accelerations by Cholesky.
///
///   A(θ) θ̈ = b(θ, θ̇),  A_ij = M_max(i,j) l² cos(θ_i − θ_j),  b_i = −M_i g l sin θ_i − Σ_j M_max(i,j) l² sin(θ_i − θ_j)
///   θ̇_j²
///
/// n is a constant: up to 20 links the factorisation is a plain LDLᵀ whose loops the compiler sees whole, above that it
/// is Eigen's blocked LLT. One sin and one cos a link.
template <class Real, int N>
class DenseEquations {
 public:
  static constexpr int links = N;
  using State = std::array<Real, std::size_t{2} * N>;

  explicit DenseEquations(const Problem& problem) {
    for (int i = 0; i < N; ++i)
      weight_[i] = Real(problem.mass) * Real(N - i) * Real(problem.gravity) * Real(problem.length);
    for (int j = 0; j < N; ++j) {
      for (int i = 0; i < N; ++i) {
        coupling_(i, j) = Real(problem.mass) * Real(N - std::max(i, j)) * Real(problem.length) * Real(problem.length);
      }
    }
  }

  static State start(const Problem& problem) {
    State y{};
    for (std::size_t i = 0; i < N; ++i) y[i] = Real(problem.angle);
    return y;
  }

  static void end(const Real* y, EndState& end) {
    end.theta.assign(y, y + N);
    end.theta_dot.assign(y + N, y + 2 * N);
  }

  void derivative(const Real* y, Real* dy) {
    assemble(y);
    factorise();
    solve(rhs_.data());
    for (int i = 0; i < N; ++i) dy[i] = y[N + i];
    for (int i = 0; i < N; ++i) dy[N + i] = rhs_[i];
  }

  /// ∂(dy)/∂y, row by row, (2n x 2n): A⁻¹ (∂b/∂θ − ∂(Aθ̈)/∂θ) and A⁻¹ ∂b/∂θ̇ in the lower half.
  void jacobian(const Real* y, Real* jacobian) {
    assemble(y);
    factorise();
    solve(rhs_.data());
    differentiate(y + N);
    for (int k = 0; k < N; ++k) {
      solve(&by_angle_(0, k));
      solve(&by_rate_(0, k));
    }
    for (int i = 0; i < N; ++i) {
      Real* upper = jacobian + 2 * N * i;
      Real* lower = upper + 2 * N * N;
      for (int k = 0; k < N; ++k) {
        upper[k] = 0;
        upper[N + k] = Real(i == k);
        lower[k] = by_angle_(i, k);
        lower[N + k] = by_rate_(i, k);
      }
    }
  }

 private:
  static constexpr bool unrolled = N <= 20;
  static constexpr int Size = unrolled ? N : Eigen::Dynamic;
  using Matrix = Eigen::Matrix<Real, Size, Size>;
  using Vector = Eigen::Matrix<Real, N, 1>;

  // Both triangles: twice the products, but every loop runs along whole columns.
  void assemble(const Real* y) {
    using std::cos, std::sin;
    for (int i = 0; i < N; ++i) {
      sine_[i] = sin(y[i]);
      cosine_[i] = cos(y[i]);
    }
    for (int i = 0; i < N; ++i) rhs_[i] = -weight_[i] * sine_[i];
    for (int j = 0; j < N; ++j) {
      const Real sine = sine_[j], cosine = cosine_[j], square = y[N + j] * y[N + j];
      for (int i = 0; i < N; ++i) {
        matrix_(i, j) = coupling_(i, j) * (cosine_[i] * cosine + sine_[i] * sine);
        rhs_[i] -= coupling_(i, j) * (sine_[i] * cosine - cosine_[i] * sine) * square;
      }
    }
  }

  void factorise() {
    if constexpr (!unrolled) {
      cholesky_.compute(matrix_);
    } else {
      for (int j = 0; j < N; ++j) {
        inverse_[j] = 1 / matrix_(j, j);
        for (int k = j + 1; k < N; ++k) {
          const Real factor = matrix_(k, j) * inverse_[j];
          for (int i = k; i < N; ++i) matrix_(i, k) -= factor * matrix_(i, j);
        }
        for (int i = j + 1; i < N; ++i) matrix_(i, j) *= inverse_[j];
      }
    }
  }

  void solve(Real* x) const {
    if constexpr (!unrolled) {
      Eigen::Map<Vector> solution(x);
      cholesky_.solveInPlace(solution);
    } else {
      for (int j = 0; j < N; ++j) {
        for (int i = j + 1; i < N; ++i) x[i] -= matrix_(i, j) * x[j];
      }
      for (int j = N; j-- > 0;) {
        Real sum = x[j] * inverse_[j];
        for (int i = j + 1; i < N; ++i) sum -= matrix_(i, j) * x[i];
        x[j] = sum;
      }
    }
  }

  void differentiate(const Real* rate) {
    by_rate_.setZero();
    for (int i = 0; i < N; ++i) by_angle_(i, i) = -weight_[i] * cosine_[i];
    for (int k = 0; k < N; ++k) {
      for (int i = 0; i < N; ++i) {
        if (i == k) continue;
        const Real cosine = coupling_(i, k) * (cosine_[i] * cosine_[k] + sine_[i] * sine_[k]);
        const Real sine = coupling_(i, k) * (sine_[i] * cosine_[k] - cosine_[i] * sine_[k]);
        const Real force = cosine * rate[k] * rate[k] - sine * rhs_[k];
        by_angle_(i, i) -= force;
        by_angle_(i, k) = force;
        by_rate_(i, k) = -2 * sine * rate[k];
      }
    }
  }

  Matrix coupling_{N, N}, matrix_{N, N}, by_angle_{N, N}, by_rate_{N, N};
  Vector weight_, sine_, cosine_, rhs_, inverse_;
  Eigen::LLT<Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>> cholesky_;
};

/// Our own O(n) dynamics, handed to the general solvers: y = (θ, p).
///
/// One sweep in from the tip and one out from the pivot gives θ̇ = A⁻¹ p and ṗ = ∂L/∂θ. What hangs below a rod answers
/// the bob above it with a mass along the rod only (π), because a string of point masses carries no moment.
template <class Real, int N>
class RecursiveEquations {
 public:
  static constexpr int links = N;
  using State = std::array<Real, std::size_t{2} * N>;

  using Links = std::array<Real, std::size_t{N}>;  ///< one number a link, from the pivot out

  explicit RecursiveEquations(const Problem& problem)
      : RecursiveEquations(filled(problem.mass), filled(problem.length), Real(problem.gravity)) {}

  /// Any chain: masses [kg], lengths [m], gravity [m/s²].
  RecursiveEquations(const Links& masses, const Links& lengths, Real gravity) {
    Real below = 0;
    for (std::size_t i = N; i-- > 0;) {
      below += masses[i];
      mass_[i] = masses[i];
      inverse_length_[i] = 1 / lengths[i];
      weight_[i] = below * gravity * lengths[i];
    }
  }

  static State start(const Problem& problem) { return DenseEquations<Real, N>::start(problem); }

  void end(const Real* y, EndState& end) {
    State dy;
    derivative(y, dy.data());
    end.theta.assign(y, y + N);
    end.theta_dot.assign(dy.data(), dy.data() + N);
  }

  void derivative(const Real* y, Real* dy) {
    sines(y);
    inward(y + N);
    outward(dy);
  }

 private:
  using Batch = xsimd::batch<double>;
  static constexpr std::size_t padded = (std::size_t{N} + Batch::size - 1) / Batch::size * Batch::size;

  // Several sines at once where the type allows it, as in our own solver.
  void sines(const Real* theta) {
    if constexpr (std::is_same_v<Real, double>) {
      std::copy_n(theta, N, angle_.data());
      for (std::size_t i = 0; i < padded; i += Batch::size) {
        const auto [sine, cosine] = xsimd::sincos(Batch::load_aligned(&angle_[i]));
        sine.store_aligned(&sine_[i]);
        cosine.store_aligned(&cosine_[i]);
      }
    } else {
      using std::cos, std::sin;
      for (std::size_t i = 0; i < N; ++i) {
        sine_[i] = sin(theta[i]);
        cosine_[i] = cos(theta[i]);
      }
    }
  }

  // Rod i sees the bob below it as velocity ν − κ (axial velocity), and pulls with π (axial velocity) + γ.
  void inward(const Real* p) {
    Real momentum = p[N - 1] * inverse_length_[N - 1], tension = mass_[N - 1], pull = 0;
    nu_[N - 1] = momentum / tension;
    kappa_[N - 1] = 0;
    pi_[N - 1] = tension;
    gamma_[N - 1] = 0;
    for (std::size_t i = N - 1; i-- > 0;) {
      const Real sine = sine_[i + 1] * cosine_[i] - cosine_[i + 1] * sine_[i];
      const Real cosine = cosine_[i + 1] * cosine_[i] + sine_[i + 1] * sine_[i];
      const Real e = 1 / (mass_[i] + tension * sine * sine);
      const Real above = p[i] * inverse_length_[i];
      const Real across = tension * sine * cosine;
      turn_sine_[i] = sine;
      turn_cosine_[i] = cosine;
      nu_[i] = (above - momentum * cosine - pull * sine) * e;
      kappa_[i] = across * e;
      pull = pull * cosine - momentum * sine + across * nu_[i];
      tension = mass_[i] * (mass_[i] + tension) * e;
      momentum = above;
      pi_[i] = tension;
      gamma_[i] = pull;
    }
  }

  void outward(Real* dy) {
    Real along = 0, across = 0;
    for (std::size_t i = 0; i < N; ++i) {
      const Real tip = nu_[i] - kappa_[i] * along;
      const Real own = tip - across;
      dy[i] = own * inverse_length_[i];
      dy[N + i] = -own * (pi_[i] * along + gamma_[i]) - weight_[i] * sine_[i];
      if (i + 1 == N) return;
      across = turn_cosine_[i] * tip - turn_sine_[i] * along;
      along = turn_cosine_[i] * along + turn_sine_[i] * tip;
    }
  }

  static Links filled(double value) {
    Links row;
    row.fill(Real(value));
    return row;
  }

  using Row = std::array<Real, padded>;
  Row mass_{}, inverse_length_{}, weight_{}, nu_{}, kappa_{}, pi_{}, gamma_{}, turn_sine_{}, turn_cosine_{};
  alignas(64) Row angle_{};
  alignas(64) Row sine_{};
  alignas(64) Row cosine_{};
};

}  // namespace bench
