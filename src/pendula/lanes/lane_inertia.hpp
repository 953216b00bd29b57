#pragma once

#include <cstddef>
#include <pendula/lanes/lane_dynamics.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/mass_scale.hpp>
#include <vector>

namespace pendula {

/// How the inertia of each coordinate compares with the largest that it has elsewhere, of several members: as MassScale
/// tells of one.
template <class L>
class LaneInertia {
 public:
  using Mask = typename L::Mask;

  /// `dynamics` must outlive it.
  explicit LaneInertia(LaneDynamics<L>& dynamics)
      : dynamics_(dynamics),
        count_(dynamics.coordinates()),
        masses_(at(count_ * count_)),
        inertias_(static_cast<std::size_t>(count_), L(1.0)),
        largest_(inertias_),
        turns_by_(inertias_) {}

  /// A member comes into a lane, with the largest pivot of coordinate k that it has.
  void start(int lane, int k, double largest) { largest_[at(k)].set(lane, largest); }

  /// Looks at the mass matrices of members that are at q  (coordinates, lanes).
  void read(const double* times, const double* q) {
    dynamics_.masses(times, q, masses_[0]);
    for (int k = 0; k < count_; ++k) inertias_[at(k)] = mass(k, k);
    singular_ = L(0.0);
    for (int k = 0; k < count_; ++k) {
      const L pivot = mass(k, k);
      eliminate(k, pivot);
      L& largest = largest_[at(k)];
      largest = max(largest, pivot);
      singular_ = select(pivot > L(MassShare::vanished) * largest, singular_, L(1.0));
      const bool may_be_small = !dynamics_.constant_masses();
      const Mask is_small = pivot < L(MassShare::small) * largest;
      turns_by_[at(k)] = may_be_small ? select(is_small, L(2.0), L(1.0)) : L(1.0);
    }
  }

  /// M_kk.
  const L& weight_squared(int k) const { return inertias_[at(k)]; }
  /// 2 where the inertia of coordinate k is far below what it is elsewhere, else 1.
  const L& turns_by(int k) const { return turns_by_[at(k)]; }
  /// Those of which a coordinate has lost more than half of its digits.
  Mask singular() const { return singular_ > L(0.0); }

 private:
  static std::size_t at(int k) { return static_cast<std::size_t>(k); }
  L mass(int i, int j) const { return L::load(masses_[at(i * count_ + j)]); }

  // Of L D Lᵀ.
  void eliminate(int k, const L& pivot) {
    for (int i = k + 1; i < count_; ++i) {
      const L factor = mass(i, k) / pivot;
      for (int j = k + 1; j < count_; ++j) (mass(i, j) - factor * mass(k, j)).store(masses_[at(i * count_ + j)]);
    }
  }

  LaneDynamics<L>& dynamics_;
  int count_;
  PackRows<L::width> masses_;
  std::vector<L> inertias_, largest_, turns_by_;
  L singular_{0.0};
};

}  // namespace pendula
