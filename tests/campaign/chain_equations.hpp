#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <vector>

/// A chain in Cartesian rod directions u_i and their rates: nothing of pendula's, neither code nor variables.
namespace reference {

using Real = long double;
using Vector = std::array<Real, 3>;  // in the plane the third component stays 0

inline Real dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

struct Drive {
  std::size_t link = 0;
  Vector amplitude{};  // N m, a vector: in the plane along the axis that points out of it
  Real frequency = 0, phase = 0;
};

struct Problem {
  std::size_t links = 0;
  Vector up{};  // y in the plane, z in space
  Real gravity = 0;
  std::vector<Real> mass, length, damping;
  std::vector<Vector> torque;
  std::vector<Drive> drives;
};

/// (u_1..u_n, u̇_1..u̇_n, t), flat: methods with a Jacobian want time among the unknowns.
using State = std::vector<Real>;

inline Vector rod(const State& y, std::size_t i) {
  return {y[3 * i], y[3 * i + 1], y[3 * i + 2]};
}

/// What turns rod i, as the force that a unit change of u_i feels: τ × u − λ u̇.
inline std::vector<Vector> turning_forces(const Problem& problem, const State& y) {
  const std::size_t n = problem.links;
  std::vector<Vector> torque = problem.torque, force(n);
  for (const Drive& drive : problem.drives) {
    const Real now = std::sin(drive.frequency * y.back() + drive.phase);
    for (std::size_t c = 0; c < 3; ++c) torque[drive.link][c] += now * drive.amplitude[c];
  }
  for (std::size_t i = 0; i < n; ++i) {
    force[i] = cross(torque[i], rod(y, i));
    const Vector rate = rod(y, n + i);
    for (std::size_t c = 0; c < 3; ++c) force[i][c] -= problem.damping[i] * rate[c];
  }
  return force;
}

/// Newton for each bob: m_i a_i = −m_i g up + (what the two rods beside it push) − T_i u_i + T_(i+1) u_(i+1), with the
/// tensions T from u_i·(a_i − a_(i−1)) = −l_i |u̇_i|², a tridiagonal system.
inline void tension_form(const Problem& problem, const State& y, State& dy) {
  const std::size_t n = problem.links;
  const std::vector<Vector> turning = turning_forces(problem, y);
  std::vector<Vector> free(n);  // accelerations of the bobs but for the tensions
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      Real force = turning[i][c] / problem.length[i];
      if (i + 1 < n) force -= turning[i + 1][c] / problem.length[i + 1];
      free[i][c] = force / problem.mass[i] - problem.gravity * problem.up[c];
    }
  }
  std::vector<Real> diagonal(n), beside(n), tension(n);  // beside[i] couples i and i + 1
  for (std::size_t i = 0; i < n; ++i) {
    const Vector u = rod(y, i), rate = rod(y, n + i);
    Real above = 0;
    if (i > 0) above = dot(u, free[i - 1]);
    diagonal[i] = (1 / problem.mass[i] + (i > 0 ? 1 / problem.mass[i - 1] : 0)) * dot(u, u);
    beside[i] = i + 1 < n ? -dot(u, rod(y, i + 1)) / problem.mass[i] : 0;
    tension[i] = dot(u, free[i]) - above + problem.length[i] * dot(rate, rate);
  }
  for (std::size_t i = 1; i < n; ++i) {
    const Real factor = beside[i - 1] / diagonal[i - 1];
    diagonal[i] -= factor * beside[i - 1];
    tension[i] -= factor * tension[i - 1];
  }
  for (std::size_t i = n; i-- > 0;) {
    tension[i] = (tension[i] - (i + 1 < n ? beside[i] * tension[i + 1] : 0)) / diagonal[i];
  }
  dy.resize(y.size());
  Vector before{};
  for (std::size_t i = 0; i < n; ++i) {
    const Vector u = rod(y, i), below = i + 1 < n ? rod(y, i + 1) : Vector{};
    Vector now;
    for (std::size_t c = 0; c < 3; ++c) {
      now[c] = free[i][c] + ((i + 1 < n ? tension[i + 1] * below[c] : 0) - tension[i] * u[c]) / problem.mass[i];
      dy[3 * i + c] = y[3 * (n + i) + c];
      dy[3 * (n + i) + c] = (now[c] - before[c]) / problem.length[i];
    }
    before = now;
  }
  dy.back() = 1;
}

/// Lagrange with multipliers, all at once and dense: Σ_j M_max(i,j) l_i l_j ü_j + κ_i u_i = −M_i g l_i up + force_i,
/// u_i·ü_i = −|u̇_i|².
inline void dense_form(const Problem& problem, const State& y, State& dy) {
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  const auto n = static_cast<Eigen::Index>(problem.links);
  const std::vector<Vector> turning = turning_forces(problem, y);
  Matrix matrix = Matrix::Zero(4 * n, 4 * n);
  Eigen::Matrix<Real, Eigen::Dynamic, 1> right(4 * n);
  std::vector<Real> below(problem.links);
  Real sum = 0;
  for (std::size_t i = problem.links; i-- > 0;) below[i] = sum += problem.mass[i];
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Vector u = rod(y, at), rate = rod(y, problem.links + at);
    for (Eigen::Index c = 0; c < 3; ++c) {
      const auto axis = static_cast<std::size_t>(c);
      for (Eigen::Index j = 0; j < n; ++j) {
        const auto other = static_cast<std::size_t>(j);
        matrix(3 * i + c, 3 * j + c) = below[std::max(at, other)] * problem.length[at] * problem.length[other];
      }
      matrix(3 * i + c, 3 * n + i) = matrix(3 * n + i, 3 * i + c) = u[axis];
      right[3 * i + c] = turning[at][axis] - below[at] * problem.gravity * problem.length[at] * problem.up[axis];
    }
    right[3 * n + i] = -dot(rate, rate);
  }
  const Eigen::Matrix<Real, Eigen::Dynamic, 1> solution = matrix.partialPivLu().solve(right);
  dy.resize(y.size());
  for (Eigen::Index k = 0; k < 3 * n; ++k) {
    dy[static_cast<std::size_t>(k)] = y[static_cast<std::size_t>(3 * n + k)];
    dy[static_cast<std::size_t>(3 * n + k)] = solution[k];
  }
  dy.back() = 1;
}

/// Back to |u| = 1, u·u̇ = 0, from which rounding and a method's error lead away.
inline void project(const Problem& problem, State& y) {
  for (std::size_t i = 0; i < problem.links; ++i) {
    const std::size_t at = 3 * i, rate = 3 * (problem.links + i);
    const Vector u = rod(y, i);
    const Real shorter = 1 / std::sqrt(dot(u, u));
    for (std::size_t c = 0; c < 3; ++c) y[at + c] *= shorter;
    const Real along = dot(rod(y, i), rod(y, problem.links + i));
    for (std::size_t c = 0; c < 3; ++c) y[rate + c] -= along * y[at + c];
  }
}

}  // namespace reference
