#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/gauss/chain_stages.hpp>

namespace pendula {

/// One fixed-point iteration on the stages of a chain, all stages in the lanes of SIMD registers:
///   Q = q + h A V,  P = p + h A f,  V ← velocities of momenta P at Q,  f ← their forces.
/// It costs a fraction of a Newton iteration, and converges where the step is small against the chain's fastest motion.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainFixedPoint {
 public:
  using Stages = ChainStages<Space, S, N, Real, Arch>;

  explicit ChainFixedPoint(int links) : sweep_(links) {}

  /// Replaces stage velocities and forces once.
  Correction correct(Stages& stages) {
    sweep_inward(stages);
    return sweep_outward(stages);
  }

 private:
  using L = typename Stages::L;
  using Sweep = MotionSweep<Space, L, N>;
  using Coordinates = typename Stages::Coordinates;
  static constexpr std::size_t K = Stages::K, Z = Stages::Z;

  // Leaves momenta where the forces were, until the way out replaces them.
  PENDULA_IN_REGISTERS void sweep_inward(Stages& stages) {
    typename Sweep::Inward carried;
    for (int end = stages.links(); end > 0;) {
      const int begin = Stages::block_before(end);
      stages.place_block(end);
      while (end > begin) {
        const int i = --end;
        const Momenta<Coordinates> p = stages.stage_momenta(i);
        stages.set_forces(i, p.value);
        sweep_.inward(carried, i, stages.constants(i), stages.placed(i), p);
      }
    }
  }

  PENDULA_IN_REGISTERS Correction sweep_outward(Stages& stages) {
    L change(Real(0)), scale(Real(0));
    typename Sweep::Outward carried(stages.placed(0));
    for (int i = 0; i < stages.links(); ++i) {
      const auto at = stages.placed(i);
      const auto next = stages.placed(std::min(i + 1, stages.links() - 1));
      const auto load = [&](Chart chart, const Coordinates& v) { return stages.load(i, chart, at.trig, v); };
      const Coordinates before = stages.rates(i);
      Coordinates v, f;
      sweep_.outward(carried, i, stages.constants(i), at, next, stages.forces(i), load, v, f);
      for (std::size_t a = 0; a < K; ++a) {
        change = max(change, abs(v[a] - before[a]));
        scale = max(scale, abs(v[a]));
      }
      stages.set_rates(i, v);
      stages.set_forces(i, f);
    }
    return {relative(change, scale, stages.rates(stages.links() - 1)), -1};
  }

  // What is not a number reaches the last link, though not always the largest change.
  static double relative(const L& change, const L& scale, const Coordinates& last) {
    L all_last = last[0];
    for (std::size_t a = 1; a < K; ++a) all_last = all_last + last[a];
    const auto plus = [](const Real& x, const Real& y) { return Real(x + y); };
    const auto larger = [](const Real& x, const Real& y) { return x > y ? x : y; };
    if (!std::isfinite(static_cast<double>(over_stages(all_last, plus))))
      return std::numeric_limits<double>::quiet_NaN();
    const Real largest_change = over_stages(change, larger);
    return largest_change > 0 ? static_cast<double>(largest_change / over_stages(scale, larger)) : 0;
  }

  // Of all stages in halves: what is done first does not wait for all the others.
  template <class Combine>
  static Real over_stages(const L& lanes, Combine combine) {
    alignas(pack_alignment) Real values[Z];
    lanes.store(values);
    for (std::size_t count = S; count > 1; count = (count + 1) / 2) {
      for (std::size_t k = 0; k < count / 2; ++k) values[k] = combine(values[k], values[k + (count + 1) / 2]);
    }
    return values[0];
  }

  MotionSweep<Space, L, N> sweep_;
};

}  // namespace pendula
