#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/gauss/chain_stages.hpp>

namespace pendula {

/// One fixed-point iteration on the stages of a chain, all stages in the lanes of SIMD registers:
///   Q = q + h A V,  P = p + h A f,  V ← velocities of momenta P at Q,  f ← their forces.
/// It costs a fraction of a Newton iteration, and converges where the step is small against the chain's fastest motion.
template <class Space, int S, int N = Eigen::Dynamic, class Arch = xsimd::default_arch>
class ChainFixedPoint {
 public:
  using Stages = ChainStages<Space, S, N, Arch>;

  explicit ChainFixedPoint(int links) : sweep_(links), inverse_determinant_(links) {}

  /// Replaces stage velocities and forces once.
  Correction correct(Stages& stages) {
    stages.place();
    for (int i = stages.links(); i-- > 0;) inward(stages, i);
    Watch watch;
    for (int i = 0; i < stages.links(); ++i) outward(stages, i, watch);
    return watch.correction();
  }

 private:
  using Link = typename Space::Link;
  using L = typename Stages::L;
  using Coordinates = typename Stages::Coordinates;
  using Cartesian = typename Stages::Cartesian;
  static constexpr std::size_t K = Stages::K, Z = Stages::Z;

  // The largest change in every lane, and the link where it was. What is not a number reaches the last link.
  struct Watch {
    L change{0.0}, scale{0.0}, last{0.0};
    L link{-1.0};

    void see(int i, const L& before, const L& after) {
      const L size = abs(after - before);
      link = select_greater(size, change, L(i), link);
      change = max(change, size);
      scale = max(scale, abs(after));
      last = after;
    }

    Correction correction() const {
      alignas(pack_alignment) double changes[Z], scales[Z], links[Z], lasts[Z];
      change.store(changes);
      scale.store(scales);
      link.store(links);
      last.store(lasts);
      std::size_t worst = 0;
      double largest_scale = 0;
      for (std::size_t k = 0; k < S; ++k) {
        if (!std::isfinite(lasts[k])) return {std::numeric_limits<double>::quiet_NaN(), static_cast<int>(links[worst])};
        if (changes[k] > changes[worst]) worst = k;
        largest_scale = std::max(largest_scale, scales[k]);
      }
      return {changes[worst] > 0 ? changes[worst] / largest_scale : 0, static_cast<int>(links[worst])};
    }
  };

  void inward(Stages& stages, int i) {
    const auto trig = stages.trig(i);
    const L inverse_length(stages.constants(i).inverse_length);
    L determinant;
    Link::metric_determinant(trig, determinant);
    const L inverse = has_charts<Space> ? L(1.0) / determinant : determinant;
    inverse.store(inverse_determinant_[i]);
    Coordinates p;
    for (std::size_t a = 0; a < K; ++a) p[a] = stages.stage_momentum(i, a) * inverse_length;
    Cartesian u, across;
    Link::direction(trig, u);
    Link::tangent_momentum(trig, inverse, p, across);
    sweep_.inward(i, stages.constants(i), to_world(stages.chart(i), u), to_world(stages.chart(i), across));
  }

  void outward(Stages& stages, int i, Watch& watch) {
    const auto trig = stages.trig(i);
    const Chart chart = stages.chart(i);
    Cartesian u_dot, G;
    sweep_.outward(i, stages.constants(i), u_dot, G);
    Coordinates v, f;
    Link::rates(trig, L::load(inverse_determinant_[i]), to_chart(chart, u_dot), v);
    const Cartesian momentum = to_chart(chart, scaled(L(stages.constants(i).length), G));
    Link::force(trig, v, momentum, stages.load(i, trig, v), f);
    const Coordinates before = stages.rates(i);
    for (std::size_t a = 0; a < K; ++a) watch.see(i, before[a], v[a]);
    stages.set_rates(i, v);
    stages.set_forces(i, f);
  }

  TensionSweep<Space, L, N> sweep_;
  detail::LinkArray<static_cast<int>(Z), N> inverse_determinant_;
};

}  // namespace pendula
