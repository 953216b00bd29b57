#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/system/system.hpp>

namespace pendula {

/// What pivots of a mass matrix are, of the largest that they have elsewhere.
struct MassShare {
  static constexpr double small = 1.0 / 16, vanished = 1e-12;
};

/// How the inertia of each coordinate, a pivot of the mass matrix, compares with the largest that it has elsewhere.
///
/// Where it vanishes the coordinate has no meaning: φ at a pole, an angle about a point that the bob is at. How large
/// it may be is seen at the start, with all angles at a few other values, and as the motion goes on.
template <System S>
class MassScale {
  using Parameters = typename S::template Parameters<double>;
  using Vector = typename S::template Vector<double>;
  using Matrix = typename S::template Matrix<double>;
  static constexpr std::size_t count = S::coordinates;
  static constexpr double small = MassShare::small, vanished = MassShare::vanished;

 public:
  void start(const Parameters& parameters, const Vector& q) {
    largest_.fill(0);
    for (int k = 1; k <= samples; ++k) {
      Vector turned = q;
      for (std::size_t i = 0; i < count; ++i) {
        if (S::coordinate_is_angle[i]) turned[index(i)] += k * (1 + 0.1 * static_cast<double>(i));
      }
      read(parameters, turned);
    }
    read(parameters, q);
  }

  void read(const Parameters& parameters, const Vector& q) {
    Matrix mass;
    S::mass_matrix(parameters, q, mass);
    see(mass);
  }

  /// Takes a mass matrix, that of the stages of a step, say.
  void see(const Matrix& mass) {
    singular_ = -1;
    for (std::size_t k = 0; k < count; ++k) inertia_[k] = mass(index(k), index(k));
    find_pivots(mass);
    for (std::size_t k = 0; k < count; ++k) {
      largest_[k] = std::max(largest_[k], pivot_[k]);
      if (singular_ < 0 && !(pivot_[k] > vanished * largest_[k])) singular_ = static_cast<int>(k);
    }
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(inertia_, pivot_, largest_, singular_);
  }

  /// M_kk, where it was looked at last.
  double inertia(std::size_t k) const { return inertia_[k]; }

  /// The largest pivot of coordinate k that was seen.
  double largest_pivot(std::size_t k) const { return largest_[k]; }

  /// Whether the inertia of coordinate k is far below what it is elsewhere.
  bool is_small(std::size_t k) const { return !S::constant_masses && pivot_[k] < small * largest_[k]; }

  /// A coordinate that has lost more than half of its digits; −1 where none has.
  int singular() const { return singular_; }

 private:
  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }

  // Of L D Lᵀ.
  void find_pivots(Matrix mass) {
    for (Eigen::Index k = 0; k < mass.rows(); ++k) {
      pivot_[static_cast<std::size_t>(k)] = mass(k, k);
      for (Eigen::Index i = k + 1; i < mass.rows(); ++i) {
        const double factor = mass(i, k) / mass(k, k);
        for (Eigen::Index j = k + 1; j < mass.rows(); ++j) mass(i, j) -= factor * mass(k, j);
      }
    }
  }

  static constexpr int samples = 8;

  std::array<double, count> inertia_{}, pivot_{}, largest_{};
  int singular_ = -1;
};

}  // namespace pendula
