#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/system/system_model.hpp>
#include <span>
#include <vector>

namespace pendula {

/// What pivots of a mass matrix are, of the largest that they have elsewhere.
struct MassShare {
  static constexpr double small = 1.0 / 16, vanished = 1e-12;
};

/// How the inertia of each coordinate, a pivot of the mass matrix, compares with the largest that it has elsewhere.
///
/// Where it vanishes the coordinate has no meaning: φ at a pole, an angle about a point that the bob is at. How large
/// it may be is seen at the start, with all angles at a few other values, and as the motion goes on.
class MassScale {
  static constexpr double small = MassShare::small, vanished = MassShare::vanished;

 public:
  /// `info` has to outlive it.
  explicit MassScale(const SystemInfo& info)
      : is_angle_(info.is_angle),
        constant_(info.constant_masses),
        inertia_(count()),
        pivot_(count()),
        largest_(count()),
        mass_(count() * count()),
        turned_(count()) {}

  /// Of a system at q  (coordinates).
  void start(const SystemAt<1>& here, const double* q) {
    std::fill(largest_.begin(), largest_.end(), 0.0);
    for (int k = 1; k <= samples; ++k) {
      for (std::size_t i = 0; i < count(); ++i) {
        turned_[i] = q[i] + (is_angle_[i] ? k * (1 + 0.1 * static_cast<double>(i)) : 0);
      }
      read(here, turned_.data());
    }
    read(here, q);
  }

  void read(const SystemAt<1>& here, const double* q) {
    here(&SystemFunctions::mass_matrix, q, mass_.data());
    see();
  }

  /// Takes a mass matrix, that of a stage of a step, say: its numbers row by row, each `apart` from the one before.
  void see(const double* mass, std::size_t apart) {
    for (std::size_t k = 0; k < mass_.size(); ++k) mass_[k] = mass[k * apart];
    see();
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
  bool is_small(std::size_t k) const { return !constant_ && pivot_[k] < small * largest_[k]; }

  /// A coordinate that has lost more than half of its digits; −1 where none has.
  int singular() const { return singular_; }

 private:
  std::size_t count() const { return is_angle_.size(); }
  double& mass(std::size_t i, std::size_t j) { return mass_[i * count() + j]; }

  void see() {
    singular_ = -1;
    for (std::size_t k = 0; k < count(); ++k) inertia_[k] = mass(k, k);
    find_pivots();
    for (std::size_t k = 0; k < count(); ++k) {
      largest_[k] = std::max(largest_[k], pivot_[k]);
      if (singular_ < 0 && !(pivot_[k] > vanished * largest_[k])) singular_ = static_cast<int>(k);
    }
  }

  // Of L D Lᵀ, in place.
  void find_pivots() {
    for (std::size_t k = 0; k < count(); ++k) {
      pivot_[k] = mass(k, k);
      for (std::size_t i = k + 1; i < count(); ++i) {
        const double factor = mass(i, k) / mass(k, k);
        for (std::size_t j = k + 1; j < count(); ++j) mass(i, j) -= factor * mass(k, j);
      }
    }
  }

  static constexpr int samples = 8;

  std::span<const bool> is_angle_;
  bool constant_;
  std::vector<double> inertia_, pivot_, largest_;
  std::vector<double> mass_, turned_;  // workspace
  int singular_ = -1;
};

}  // namespace pendula
