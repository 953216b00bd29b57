#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/rod_state.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/written_out.hpp>
#include <utility>

namespace pendula {

/// The rods of a chain and their stages in a Gauss step, with the forces at the stages besides multipliers and gravity:
/// damping and torques; of one motion (StagesInLanes) or of several members (MembersInLanes).
///
/// Damping and torque join τ_i ξ̇_i of the field (ChainMotion) as (λ_i ξ̇_i − torque_i × ξ_i)/l_i².
///
/// Multipliers grow through a step as tensions do. Where they grow too far the stage equations have a fold: with two
/// stages at h ω = √12, if the chain swings with ω. So in a step that does not resolve ω, M |g|/l ξ joins τ ξ̇, from a
/// term Σ M |g|/l (|ξ|² − l²)/2 of H, which is zero on the motion. For a chain at rest τ is then zero, and steps may be
/// as long as in angles.
template <class SpaceType, class LayoutType, int N>
class ChainForces {
 public:
  using Space = SpaceType;
  using Layout = LayoutType;
  using Num = typename Layout::Num;
  using C = ConstantOf<Num>;
  using Columns = typename Layout::Columns;
  using Cell = typename Layout::Cell;
  using Row = typename Layout::Row;
  using Rods = RodState<Space, N, Num>;
  static constexpr std::size_t D = Space::dimension;
  using Point = std::array<Num, D>;

  ChainForces(int links, Family family)
      : links_(links), columns_(family), rods_(links), constants_(links), stages_(links), torques_(0) {}

  int links() const {
    if constexpr (N == Eigen::Dynamic) return links_;
    return N;
  }
  const Columns& columns() const { return columns_; }
  const Rods& rods() const { return rods_; }
  const LinkConstants<C>& constants(int i) const { return constants_[i]; }
  C h() const { return columns_.h(); }

 protected:
  struct Stage {
    std::array<Row, D> U{};  // h b (ξ̇ − z)
    Row tau{};
    std::array<Row, D> rod{};  // X, as the last iteration placed it
  };
  using Torques = std::array<Row, static_cast<std::size_t>(Space::torque_components)>;

  static Point zero() {
    return components<D>([](std::size_t) { return Num(0.0); });
  }
  template <class T>
  static decltype(auto) spread(const T& x) {
    return Layout::spread(x);
  }
  template <class Body>
  [[gnu::always_inline]] static void each_cell(Body body) {
    detail::unrolled<Layout::cells>(body);
  }

  /// h b ξ̇ of a link at a cell, and X.
  std::array<Cell, D> advance(int i, int j) const {
    return components<D>([&](std::size_t k) {
      return Cell(fma(columns_.at_hand().hb(j), spread(rods_.free(i)[k]), stages_[i].U[k][j]));
    });
  }
  std::array<Cell, D> rod(int i, int j) const {
    return components<D>([&](std::size_t k) { return Cell(stages_[i].rod[k][j]); });
  }

  bool has_loads() const { return has_loads_; }
  /// Makes room for torques.
  void expect_loads() {
    if (std::exchange(has_loads_, true)) return;
    torques_ = detail::PerLink<Torques, N>(links());
  }

  /// The force on a rod at a cell besides its multiplier's, times h b.
  template <class Weight>
  [[gnu::always_inline]] std::array<Cell, D> more_pull(int i, int j, const Weight& hb, const std::array<Cell, D>& rod,
                                                       const std::array<Cell, D>& advance) const {
    const auto tension = hb * spread(hangs_ * constants_[i].hanging);
    std::array<Cell, D> pull;
    if (has_loads()) {
      pull = load_pull(i, j, rod, advance);
      for (std::size_t k = 0; k < D; ++k) pull[k] = fma(tension, rod[k], pull[k]);
    } else {
      for (std::size_t k = 0; k < D; ++k) pull[k] = tension * rod[k];
    }
    return pull;
  }

  /// The same at all stages, whose rods are placed.
  std::array<Row, D> more_pull(int i) const {
    std::array<Row, D> pull;
    each_cell([&](auto j) PENDULA_WRITTEN_OUT {
      const std::array<Cell, D> at_cell = more_pull(i, j, columns_.at_hand().hb(j), rod(i, j), advance(i, j));
      for (std::size_t k = 0; k < D; ++k) pull[k].set(j, at_cell[k]);
    });
    return pull;
  }

  /// The work of loads in the solved step  [J].
  C work() const {
    typename Layout::Sum work(C(0.0));
    const auto inverse_h = spread(select(h() == C(0.0), C(0.0), C(1.0) / h()));
    for (int i = 0; i < links(); ++i) {
      each_cell([&](auto j) {
        const std::array<Cell, D> moved = advance(i, j), pull = load_pull(i, j, rod(i, j), moved);
        for (std::size_t k = 0; k < D; ++k) {
          work = fma(-(inverse_h * columns_.inverse_weight(j)) * detail::value_of(pull[k]), detail::value_of(moved[k]),
                     work);
        }
      });
    }
    return Layout::total(work);
  }

  /// Whether a step of h resolves the fastest swinging, (h ω)² <= 4, with a bound of ω² at rest by Gershgorin's
  /// theorem.
  auto resolves(const C& h) const { return h * h * fastest_swing_ <= C(4.0); }

  int links_;
  Columns columns_;
  C fastest_swing_{0.0}, hangs_{0.0};  // ω² at rest; 1 where the step does not resolve it
  Rods rods_;
  detail::PerLink<LinkConstants<C>, N> constants_;
  detail::PerLink<Stage, N> stages_;
  detail::PerLink<Torques, N> torques_;  // times h b, over l²

 private:
  [[gnu::always_inline]] std::array<Cell, D> load_pull(int i, int j, const std::array<Cell, D>& rod,
                                                       const std::array<Cell, D>& advance) const {
    typename Space::Link::template Torque<Cell> torque;
    for (std::size_t k = 0; k < torque.size(); ++k) torque[k] = torques_[i][k][j];
    std::array<Cell, D> turning;
    Space::Link::torque_load(torque, rod, turning);
    const auto& drag = spread(constants_[i].drag);  // damping, λ/l²
    return components<D>([&](std::size_t k) { return Cell(drag * advance[k] - turning[k]); });
  }

  bool has_loads_ = false;
};

}  // namespace pendula
