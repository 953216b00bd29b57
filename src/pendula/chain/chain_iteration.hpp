#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/written_out.hpp>
#include <type_traits>
#include <utility>

namespace pendula {

/// Weight of the squared corrections of a tangent beside those of its motion: the motion is solved to more digits.
inline constexpr double solved_share = 1e-12;

/// sum + x². For a number with its derivative, the square of the derivative is added, too, with that weight.
template <class L>
[[gnu::always_inline]] inline L add_square(const L& x, const L& sum) {
  return fma(x, x, sum);
}
template <class L>
[[gnu::always_inline]] inline L add_square(const Dual<L>& x, const L& sum) {
  return fma(L(solved_share) * x.slope, x.slope, fma(x.value, x.value, sum));
}

/// A mask for `select` that is always true: the compiler leaves the selection out.
struct Everyone {};
template <class T>
[[gnu::always_inline]] inline const T& select(Everyone, const T& yes, const T&) {
  return yes;
}

/// One fixed-point iteration on the stages of a chain: rods and free rates follow from increments and multipliers, and
/// new increments and multipliers from these. It costs a fraction of a Newton iteration, and converges where the step
/// is short compared with the chain's fastest motion.
///
/// Pointers and coefficients that every link needs are members here, so that they stay in registers: otherwise a
/// compiler must assume that stores to stages change them. Rows are worked on cell by cell, by two cells at a time
/// where there are several, so that the latency of one hides that of the other. With several cells a row, all rods are
/// placed in a pass of their own, before the sweeps. With one, the sweep places each rod when it reaches it.
template <class Motion>
class ChainIteration {
  using Num = typename Motion::Num;
  using C = typename Motion::C;
  using Layout = typename Motion::Layout;
  using Cell = typename Layout::Cell;
  using Row = typename Layout::Row;
  using Sum = typename Layout::Sum;
  using Stage = typename Motion::Stage;
  static constexpr std::size_t D = Motion::D;
  static constexpr int N = Motion::links_known;
  using Point = std::array<Cell, D>;

 public:
  explicit ChainIteration(Motion& motion)
      : motion_(motion),
        links_(motion.links()),
        pulls_more_(motion.pulls_more_),
        stages_(&motion.stages_[0]),
        pulled_(&motion.pulled_[0]),
        kept_(&motion.kept_[0]),
        constants_(&motion.constants_[0]),
        along_(motion.rods_.along(0)),
        along_low_(motion.rods_.along_low(0)),
        free_(motion.rods_.free(0)),
        free_low_(motion.rods_.free_low(0)),
        product_(motion.rods_.products()),
        gravity_(motion.gravity_),
        columns_(motion.columns_.at_hand()) {}

  /// Iterates those that are `active`. Returns Σ (h b Δω)² over stages and links. Calls visit(i, (h b Δξ̇)² of link i at
  /// the stages of some cells).
  template <class Who, class Visit>
  [[gnu::always_inline]] C iterate(const Who& active, Visit visit) {
    Sum change(C(0.0));
    if constexpr (!places_on_the_way) {
      for_links([&](auto i) PENDULA_WRITTEN_OUT { place(i, pulled_[i]); });
      if (pulls_more_) motion_.pull_more();
      if constexpr (Layout::stages > 2) asm volatile("" ::: "memory");  // so that sweeps read placed rods from memory
    }
    detail::unrolled<Layout::cells / Layout::together>([&](auto group) PENDULA_WRITTEN_OUT {
      sweep<group * Layout::together, Layout::together>(active, change, visit);
    });
    if constexpr (Layout::cells % Layout::together == 1) sweep<Layout::cells - 1, 1>(active, change, visit);
    return Layout::total(change);
  }

  /// Places the rod of a link at all stages.
  [[gnu::always_inline]] void place(int i) {
    typename Motion::Pulled pulled;
    place(i, pulled);
  }

 private:
  static constexpr bool places_on_the_way = Motion::places_on_the_way;
  static constexpr bool is_short = detail::is_short_chain<N>;

  // A placed rod at one cell: PlacedHere holds it in registers, PlacedThere refers to memory.
  struct PlacedHere {
    Point rods, pulls;
    Cell product;
    const Cell& rod(std::size_t k) const { return rods[k]; }
    const Cell& pull(std::size_t k) const { return pulls[k]; }
    const Cell& known() const { return product; }
  };
  struct PlacedThere {
    const Stage* stage;
    const typename Motion::Pulled* pulled;
    int j;
    decltype(auto) rod(std::size_t k) const { return stage->rod[k][j]; }
    decltype(auto) pull(std::size_t k) const { return pulled->pull[k][j]; }
    decltype(auto) known() const { return pulled->known[j]; }
  };
  using Placed = std::conditional_t<places_on_the_way, PlacedHere, PlacedThere>;

  template <class T>
  [[gnu::always_inline]] static decltype(auto) spread(const T& x) {
    return Layout::spread(x);
  }
  static std::size_t at(int i, std::size_t k) { return static_cast<std::size_t>(i) * D + k; }

  int links() const {
    if constexpr (N > 0) return N;
    return links_;
  }
  template <class Body>
  [[gnu::always_inline]] void for_links(Body body) {
    detail::for_links<N>(links(), body);
  }

  // Computes X of a link at all stages, and the integral of its pull up to each stage.
  [[gnu::always_inline]] void place(int i, typename Motion::Pulled& pulled) {
    Stage& stage = stages_[i];
    Point rods, advances, pulls;  // of the only cell
    detail::unrolled<static_cast<int>(D)>([&](auto component) PENDULA_WRITTEN_OUT {
      constexpr std::size_t k = component;
      const auto& z = spread(free_[at(i, k)]);
      Row moved, pull;
      columns_.integrate(stage.U[k], along_low_[at(i, k)], moved);
      detail::unrolled<Layout::cells>([&](auto j) PENDULA_WRITTEN_OUT {
        const Cell far = fma(columns_.hc(j), z, fma(columns_.hc_low(j), z, moved[j]));
        const Cell advance = fma(columns_.hb(j), z, stage.U[k][j]);
        rods[k] = spread(along_[at(i, k)]) + far;
        stage.rod[k].set(j, rods[k]);
        if constexpr (k == 0) {
          pulled.known.set(j, fma(far, z, Cell(spread(product_[i]))));
        } else {
          pulled.known.set(j, fma(far, z, pulled.known[j]));
        }
        advances[k] = advance;
        pulls[k] = stage.tau[j] * advance;
        if constexpr (!places_on_the_way) pull.set(j, pulls[k]);
      });
      if constexpr (!places_on_the_way) columns_.integrate(pull, Num(0.0), pulled.pull[k]);
    });
    if constexpr (places_on_the_way) {
      if (pulls_more_) pulls = sum(pulls, motion_.more_pull(i, 0, columns_.hb(0), rods, advances));
      for (std::size_t k = 0; k < D; ++k) {
        Row pull;
        pull.set(0, pulls[k]);
        columns_.integrate(pull, Num(0.0), pulled.pull[k]);
      }
    }
  }

  [[gnu::always_inline]] Placed placed(int i, int j) {
    if constexpr (places_on_the_way) {
      typename Motion::Pulled pulled;
      place(i, pulled);
      return {components<D>([&](std::size_t k) PENDULA_WRITTEN_OUT { return stages_[i].rod[k][j]; }),
              components<D>([&](std::size_t k) PENDULA_WRITTEN_OUT { return pulled.pull[k][j]; }), pulled.known[j]};
    } else {
      return {&stages_[i], &pulled_[i], j};
    }
  }

  // Computes multipliers and increments of `Count` cells from `First` on, in a sweep from the tip to the pivot and
  // back.
  template <int First, int Count, class Who, class Visit>
  [[gnu::always_inline]] void sweep(const Who& active, Sum& change, Visit& visit) {
    if constexpr (is_short) {
      std::array<typename Motion::template Elimination<Count>, static_cast<std::size_t>(N)> kept;
      sweep_inward<First, Count>(kept);
      sweep_outward<First, Count>(kept, active, change, visit);
    } else {
      sweep_inward<First, Count>(kept_);
      sweep_outward<First, Count>(kept_, active, change, visit);
    }
  }
  template <class Links>
  [[gnu::always_inline]] static auto& kept_at(Links& kept, int i) {
    if constexpr (is_short) {
      return kept[static_cast<std::size_t>(i)];
    } else {
      return kept[i];
    }
  }

  // From the tip to the pivot: finds Z − z of every link, and eliminates the multipliers.
  template <int First, int Count, class Links>
  [[gnu::always_inline]] void sweep_inward(Links& kept) {
    struct Carried {
      Placed here;
      Point bond;
      MultiplierRow<Cell> row;
      Cell beyond{C(0.0)};
    };
    std::array<Carried, static_cast<std::size_t>(Count)> carried;
    detail::unrolled<Count>([&](auto c) PENDULA_WRITTEN_OUT {
      const int tip = links() - 1;
      Carried& carry = carried[c];
      carry.here = placed(tip, First + c);
      const auto inverse_mass = spread(constants_[tip].inverse_mass.value);
      for (std::size_t k = 0; k < D; ++k) carry.bond[k] = -inverse_mass * carry.here.pull(k);
    });
    detail::for_links_inward<N>(links(), [&](auto i) PENDULA_WRITTEN_OUT {
      detail::unrolled<Count>([&](auto c) PENDULA_WRITTEN_OUT {
        constexpr int j = First + c;
        Carried& carry = carried[c];
        const Placed next = i > 0 ? placed(i - 1, j) : carry.here;
        Cell product = carry.here.known(), before(C(0.0)), square(C(0.0));
        detail::unrolled<static_cast<int>(D)>([&](auto component) PENDULA_WRITTEN_OUT {
          constexpr std::size_t k = component;
          Cell freed = carry.bond[k];
          if (i > 0) {
            carry.bond[k] = spread(constants_[i - 1].inverse_mass.value) * (carry.here.pull(k) - next.pull(k));
            freed = freed - carry.bond[k];
            before = fma(carry.here.rod(k), next.rod(k), before);
          } else if (k == D - 1) {
            freed = fma(-columns_.hc(j), spread(gravity_), freed);
          }
          freed = spread(free_low_[at(i, k)]) + freed;
          product = fma(carry.here.rod(k), freed, product);  // X·Z = ξ·z, which is exact, + (X − ξ)·z + X·(Z − z)
          square = fma(carry.here.rod(k), carry.here.rod(k), square);
          kept_at(kept, i).freed[c][k].set(0, freed);
        });
        if (i > 0) before = -spread(constants_[i - 1].inverse_mass.value) * before;
        square = spread(constants_[i].inverse_masses) * square;
        eliminate<c>(i, kept, square, before, -product, carry.row, carry.beyond);
        carry.beyond = before;
        carry.here = next;
      });
    });
  }

  // A chain of two links takes one division: both multipliers are found here, as rows without coupling.
  template <int c, class Links>
  [[gnu::always_inline]] void eliminate(int i, Links& kept, const Cell& square, const Cell& before, const Cell& right,
                                        MultiplierRow<Cell>& row, const Cell& beyond) {
    if (N == 2 && i == 1) {
      row = {right, square};
    } else if (N == 2) {
      const Cell inverse = Cell(C(1.0)) / fma(-beyond, beyond, square * row.coupling);
      kept_at(kept, 0).offset[c].set(0, fma(-beyond, row.offset, right * row.coupling) * inverse);
      kept_at(kept, 1).offset[c].set(0, fma(-beyond, right, square * row.offset) * inverse);
    } else {
      const Cell inverse = Cell(C(1.0)) / fma(-beyond, row.coupling, square);
      row = {fma(-beyond, row.offset, right) * inverse, before * inverse};
      kept_at(kept, i).offset[c].set(0, row.offset);
      kept_at(kept, i).coupling[c].set(0, row.coupling);
    }
  }

  // From the pivot to the tip: finds the multipliers, and the increments that follow from them.
  template <int First, int Count, class Links, class Who, class Visit>
  [[gnu::always_inline]] void sweep_outward(const Links& kept, const Who& active, Sum& change, Visit& visit) {
    std::array<Point, static_cast<std::size_t>(Count)> bond_before;
    std::array<Cell, static_cast<std::size_t>(Count)> tau;
    detail::unrolled<Count>([&](auto c) PENDULA_WRITTEN_OUT {
      bond_before[c].fill(Cell(C(0.0)));
      tau[c] = kept_at(kept, 0).offset[c][0];
    });
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      Stage& stage = stages_[i];
      const auto& inverse_mass = spread(constants_[i].inverse_mass.value);
      Sum changed(C(0.0));
      detail::unrolled<Count>([&](auto c) PENDULA_WRITTEN_OUT {
        constexpr int j = First + c;
        stage.tau.set(j, select(active, tau[c], Cell(stage.tau[j])));
        Point pull = components<D>([&](std::size_t k) PENDULA_WRITTEN_OUT { return tau[c] * stage.rod[k][j]; });
        if (i + 1 < links()) {
          const Cell offset = kept_at(kept, i + 1).offset[c][0];
          tau[c] = N == 2 ? offset : fma(-Cell(kept_at(kept, i + 1).coupling[c][0]), tau[c], offset);
          for (std::size_t k = 0; k < D; ++k) pull[k] = fma(-tau[c], stages_[i + 1].rod[k][j], pull[k]);
        }
        for (std::size_t k = 0; k < D; ++k) {
          const Cell bond = inverse_mass * pull[k], old = stage.U[k][j];
          const Cell U = columns_.hb(j) * (kept_at(kept, i).freed[c][k][0] + (bond - bond_before[c][k]));
          changed = add_square(Cell(U - old), changed);
          stage.U[k].set(j, select(active, U, old));
          bond_before[c][k] = bond;
        }
      });
      visit(i, changed);
      change = fma(changed, spread(constants_[i].inverse_square), change);
    });
  }

  Motion& motion_;
  const int links_;
  const bool pulls_more_;
  Stage* const stages_;
  typename Motion::Pulled* const pulled_;
  typename Motion::template Elimination<Layout::together>* const kept_;
  const LinkConstants<C>* const constants_;
  const Num *const along_, *const along_low_, *const free_, *const free_low_, *const product_;
  const C gravity_;
  const decltype(std::declval<const typename Layout::Columns&>().at_hand()) columns_;
};

}  // namespace pendula
