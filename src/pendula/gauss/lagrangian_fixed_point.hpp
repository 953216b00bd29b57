#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/numeric/lanes.hpp>

namespace pendula {

/// One fixed-point iteration on the stages of any system, all stages in the lanes of SIMD registers: coordinates and
/// momenta that the increments make, then the increments that they have, from one call of the kernel.
template <System S, int Width>
class LagrangianFixedPoint {
 public:
  using Stages = LagrangianStages<S, Width>;

  /// Replaces the increments once.
  PENDULA_IN_REGISTERS Correction correct(Stages& stages) const {
    Lanes Q, P, V, F;
    for (std::size_t k = 0; k < Stages::count; ++k) {
      Q[at(k)] = stages.position(k);
      P[at(k)] = stages.momentum(k);
    }
    S::hamiltonian_form(stages.parameters(), Q, P, stages.inputs(), V, F);
    const L hb = stages.columns().hb();
    L largest(0.0), scale(0.0), all(0.0);
    for (std::size_t k = 0; k < Stages::count; ++k) {
      const L weight(stages.weight(k)), inverse_weight(stages.inverse_weight(k));
      const L moved = hb * V[at(k)], pushed = hb * F[at(k)];
      const L moved_change = moved - L::load(stages.moved(k)), pushed_change = pushed - L::load(stages.pushed(k));
      largest = max(largest, max(weight * abs(moved_change), inverse_weight * abs(pushed_change)));
      scale = max(scale, max(weight * abs(moved), inverse_weight * abs(pushed)));
      all = all + (moved_change + pushed_change);
      moved.store(stages.moved(k));
      pushed.store(stages.pushed(k));
    }
    return {relative(stages, largest, scale, all), -1};
  }

  /// The coordinate that one more iteration changes most.
  int worst_coordinate(Stages& stages) const {
    std::size_t worst = 0;
    double most = -1;
    double before[2 * Stages::count][static_cast<std::size_t>(Width)];
    for (std::size_t k = 0; k < Stages::count; ++k) {
      std::copy_n(stages.moved(k), Width, before[k]);
      std::copy_n(stages.pushed(k), Width, before[Stages::count + k]);
    }
    correct(stages);
    for (std::size_t k = 0; k < Stages::count; ++k) {
      double change = 0;
      for (int j = 0; j < stages.stages(); ++j) {
        change += stages.weight(k) * std::abs(stages.moved(k)[j] - before[k][j]) +
                  std::abs(stages.pushed(k)[j] - before[Stages::count + k][j]) / stages.weight(k);
      }
      if (!(change <= most)) {
        most = change;
        worst = k;
        if (std::isnan(change)) break;
      }
    }
    return static_cast<int>(worst);
  }

 private:
  using L = typename Stages::L;
  using Lanes = typename Stages::Lanes;

  static constexpr Eigen::Index at(std::size_t k) { return static_cast<Eigen::Index>(k); }

  // NaN if any change is no number: that reaches their sum, though not always the largest.
  static double relative(const Stages& stages, const L& largest, const L& scale, const L& all) {
    alignas(pack_alignment) typename Stages::Stored changes, sizes, sums;
    largest.store(changes);
    scale.store(sizes);
    all.store(sums);
    double change = 0, size = stages.floor(), sum = 0;
    for (int j = 0; j < stages.stages(); ++j) {
      change = std::max(change, changes[j]);
      size = std::max(size, sizes[j]);
      sum += sums[j];
    }
    if (!std::isfinite(sum)) return std::numeric_limits<double>::quiet_NaN();
    return change > 0 ? change / size : 0;
  }
};

}  // namespace pendula
