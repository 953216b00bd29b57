#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Compares the inertia of each coordinate, a pivot of the mass matrix, with the largest value that it takes elsewhere;
/// for one motion or for several members.
///
/// Where the inertia vanishes, the coordinate is undefined: φ at a pole, or an angle about a point where the bob is.
/// The largest value is estimated at the start, with all angles at a few other values, and updated along the motion.
template <class Num>
class MassScale {
 public:
  using Mask = MaskOf<Num>;

  /// `info` must outlive this object.
  explicit MassScale(const SystemInfo& info)
      : is_angle_(info.is_angle),
        constant_(info.constant_masses),
        inertia_(count(), Num(1.0)),
        pivot_(inertia_),
        largest_(inertia_),
        mass_(count() * count()) {}

  /// Starts for a system at q  (coordinates).
  void start(const SystemAt<1>& here, const double* q) requires(!is_batch<Num>) {
    std::vector<double> turned(count());
    std::fill(largest_.begin(), largest_.end(), 0.0);
    for (int k = 1; k <= samples; ++k) {
      for (std::size_t i = 0; i < count(); ++i) {
        turned[i] = q[i] + (is_angle_[i] ? k * (1 + 0.1 * static_cast<double>(i)) : 0);
      }
      read(here, turned.data());
    }
    read(here, q);
  }
  /// Starts a member, with the scale found for it alone.
  void start(int member, const MassScale<double>& own) {
    for (std::size_t k = 0; k < count(); ++k) set(largest_[k], member, own.largest_pivot(k));
  }

  void read(const SystemAt<1>& here, const double* q) requires(!is_batch<Num>) {
    here(&SystemFunctions::mass_matrix, q, numbers());
    see();
  }

  /// Updates from a mass matrix, such as that of a stage: its entries row by row, each `apart` numbers after the one
  /// before.
  void see(const double* mass, std::size_t apart) requires(!is_batch<Num>) {
    for (std::size_t k = 0; k < count() * count(); ++k) numbers()[k] = mass[k * apart];
    see();
  }

  /// numbers() is room for mass matrices  (coordinates, coordinates, members). see() updates from these, and overwrites
  /// them.
  double* numbers() { return mass_[0]; }
  void see() {
    for (std::size_t k = 0; k < count(); ++k) inertia_[k] = mass(k, k);
    singular_ = Num(0.0);
    for (std::size_t k = 0; k < count(); ++k) {
      pivot_[k] = mass(k, k);
      eliminate(k);
      largest_[k] = max(largest_[k], pivot_[k]);
      singular_ = select(is_there(k), singular_, Num(1.0));
    }
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(inertia_, pivot_, largest_, singular_);
  }

  /// M_kk of the last update.
  const Num& inertia(std::size_t k) const { return inertia_[k]; }

  /// The largest pivot of coordinate k so far.
  const Num& largest_pivot(std::size_t k) const { return largest_[k]; }

  /// Whether the inertia of coordinate k is far below its largest value.
  Mask is_small(std::size_t k) const { return constant_ ? Num(1.0) < Num(0.0) : pivot_[k] < Num(small) * largest_[k]; }

  /// Whether the pivot of a coordinate has almost vanished; singular() returns which coordinate, −1 for none.
  Mask is_singular() const { return singular_ > Num(0.0); }
  int singular() const requires(!is_batch<Num>) {
    std::size_t k = 0;
    while (k < count() && is_there(k)) ++k;
    return k < count() ? static_cast<int>(k) : -1;
  }

 private:
  static constexpr double small = 1.0 / 16, vanished = 1e-12;  // pivots, relative to the largest
  static constexpr int samples = 8;

  std::size_t count() const { return is_angle_.size(); }
  Num mass(std::size_t i, std::size_t j) const { return from_row<Num>(mass_[i * count() + j]); }
  Mask is_there(std::size_t k) const { return pivot_[k] > Num(vanished) * largest_[k]; }

  // One column of the L D Lᵀ factorisation, in place.
  void eliminate(std::size_t k) {
    for (std::size_t i = k + 1; i < count(); ++i) {
      const Num factor = mass(i, k) / pivot_[k];
      for (std::size_t j = k + 1; j < count(); ++j) {
        to_row(Num(mass(i, j) - factor * mass(k, j)), mass_[i * count() + j]);
      }
    }
  }

  std::span<const bool> is_angle_;
  bool constant_;
  std::vector<Num> inertia_, pivot_, largest_;
  PackRows<width_of<Num>> mass_;
  Num singular_{0.0};
};

}  // namespace pendula
