#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/chain/chain_links.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/numeric/lanes.hpp>

namespace pendula::detail {

/// The size of the change of a chain's stages in one iteration, gathered link by link; S stages in the lanes of an L.
template <int S, class L>
class StageChange {
  using Real = pendula::ScalarOf<L>;

 public:
  /// Adds a rod whose increments change by dU; `advance` is h b ξ̇. Returns by how much the change turns it.
  template <std::size_t D>
  L add(const std::array<L, D>& rod, const std::array<L, D>& dU, const std::array<L, D>& advance,
        const Real& inverse_square) {
    const L scale(inverse_square);
    const L turned = largest_across(rod, dU) * scale;
    largest_ = max(largest_, turned);
    scale_ = max(scale_, largest_across(rod, advance) * scale);
    for (const L& component : dU) all_ = all_ + component;
    return turned;
  }

  /// The largest change relative to the fastest turn. NaN if any change is NaN: it reaches the sum, though not always
  /// the maximum.
  double relative() const {
    if (!std::isfinite(static_cast<double>(over_stages(all_, plus)))) return std::numeric_limits<double>::quiet_NaN();
    const Real change = largest_of(largest_);
    return change > 0 ? static_cast<double>(change / largest_of(scale_)) : 0;
  }

  /// The largest of all stages.
  static Real largest_of(const L& lanes) {
    return over_stages(lanes, [](const Real& x, const Real& y) { return x > y ? x : y; });
  }

 private:
  static Real plus(const Real& x, const Real& y) { return x + y; }

  // Combines the stages pairwise, halving their number each time: so operations do not wait for each other in one long
  // chain.
  template <class Combine>
  static Real over_stages(const L& lanes, Combine combine) {
    alignas(pack_alignment) Real values[L::size];
    lanes.store(values);
    for (std::size_t count = S; count > 1; count = (count + 1) / 2) {
      for (std::size_t k = 0; k < count / 2; ++k) values[k] = combine(values[k], values[k + (count + 1) / 2]);
    }
    return values[0];
  }

  L largest_{Real(0)}, scale_{Real(0)}, all_{Real(0)};  // largest turn by a change, in the step; sum of all changes
};

/// The link with the largest change, or the first one whose change is NaN.
template <class Real>
class WorstLink {
 public:
  void see(int link, const Real& change) {
    if (change <= largest_ || (link_ >= 0 && !std::isfinite(static_cast<double>(largest_)))) return;
    largest_ = change;
    link_ = link;
  }
  int link() const { return link_; }

 private:
  Real largest_{0};
  int link_ = -1;
};

}  // namespace pendula::detail
