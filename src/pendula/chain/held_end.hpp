#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cstddef>
#include <pendula/chain/chain_end.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/gauss/lobatto_nodes.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/stage_product.hpp>

namespace pendula {

/// How a hook holds the last bob of a chain in a step of a Gauss method with S stages: by impulses at the Lobatto nodes
/// (LobattoNodes; docs/explanation/method.md). In rods ξ and free rates z the end of the chain is Σ ξ, which is linear,
/// and an impulse J acts on the free rate of the last rod alone, by J/m. So the path of the end at the nodes tells what
/// the rates of all rods sum up to at the stages, before anything is solved.
template <std::size_t D, int S>
class HeldEnd {
  static constexpr int width = lanes_for<double>(S);
  static constexpr auto Z = static_cast<std::size_t>(width), stages = static_cast<std::size_t>(S);

 public:
  using L = typename LobattoNodes<width>::L;
  using Lanes = std::array<L, D>;
  using Vector = std::array<double, D>;

  explicit HeldEnd(const ChainEnd& end) : end_(end), nodes_(S) {
    Eigen::Matrix<double, S, S> reach, push;
    for (std::size_t j = 0; j < stages; ++j) {
      for (std::size_t k = 0; k < stages; ++k) {
        reach(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) = nodes_.reach(j, k + 1);
        push(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(k)) = k == 0 ? 1 : 1 - nodes_.reach(j, k);
      }
    }
    store(reach.inverse(), from_nodes_);
    store(push.inverse(), from_stages_);
  }

  const ChainEnd& end() const { return end_; }

  /// For a step of h from `time`, where the last bob is `gap` beside the hook and free rates sum up to `rate`: what
  /// multipliers and forces have to add to their sum at the stages. `inverse_hb` is zero in lanes without a stage.
  Lanes wanted(double time, double h, const Vector& gap, const Vector& rate, const L& inverse_hb) const {
    return components<D>([&](std::size_t k) {
      alignas(pack_alignment) double lacking[Z] = {};
      for (std::size_t node = 0; node < stages; ++node) {
        const double share = nodes_.d(node + 1);
        lacking[node] = end_.moved(k, time, h * share) - (gap[k] + h * share * rate[k]);
      }
      return L(product(from_nodes_, lacking) * inverse_hb);
    });
  }

  /// The sum of the impulses at the nodes 0 … S − 1 that push the free rate of the last rod like this at the stages,
  /// over the mass of the last bob. That at the end of the step follows from the state there.
  Vector together(const Lanes& pushes) const {
    return components<D>([&](std::size_t k) {
      double sum = 0;
      each_impulse(pushes[k], [&](std::size_t, double impulse) { sum += impulse; });
      return sum;
    });
  }
  /// What a hook that moves brings by these, over the mass of the last bob  [J/kg].
  double work(const Lanes& pushes, double time, double h) const {
    double work = 0;
    for (std::size_t k = 0; k < D; ++k) {
      each_impulse(pushes[k], [&](std::size_t node, double impulse) {
        work += impulse * end_.rate(k, time + h * nodes_.d(node));
      });
    }
    return work;
  }

 private:
  using Columns = double[Z][Z];

  static void store(const Eigen::Matrix<double, S, S>& matrix, Columns& columns) {
    for (std::size_t j = 0; j < stages; ++j) {
      for (std::size_t i = 0; i < stages; ++i) {
        columns[j][i] = matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      }
    }
  }
  static L product(const Columns& columns, const double* x) {
    return detail::stage_product<L, Z, Z>(&columns[0][0], x, L(0.0));
  }
  template <class Visit>
  void each_impulse(const L& pushes, Visit visit) const {
    alignas(pack_alignment) double stored[Z];
    pushes.store(stored);
    product(from_stages_, stored).store(stored);
    for (std::size_t node = 0; node < stages; ++node) visit(node, stored[node]);
  }

  ChainEnd end_;
  LobattoNodes<width> nodes_;
  alignas(pack_alignment) Columns from_nodes_{};   // increments of stages from changes at nodes
  alignas(pack_alignment) Columns from_stages_{};  // impulses at nodes from what they add at stages
};

}  // namespace pendula
