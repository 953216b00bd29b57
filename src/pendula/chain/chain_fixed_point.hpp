#pragma once

#include <pendula/chain/chain_stages.hpp>
#include <pendula/chain/stage_change.hpp>
#include <pendula/gauss/stage_solver.hpp>

namespace pendula {

/// One fixed-point iteration on the stages of a chain, all stages in the lanes of SIMD registers: the rods and free
/// rates that increments and multipliers make, then the increments and multipliers that they have.
///
/// It costs a fraction of a Newton iteration, and converges where the step is small against the chain's fastest motion.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainFixedPoint {
 public:
  using Stages = ChainStages<Space, S, N, Real, Arch>;

  /// Replaces increments and multipliers once.
  Correction correct(Stages& stages) {
    sweep_inward(stages);
    return sweep_outward(stages, [](int, const L&) {});
  }

  /// The link where one more iteration changes most.
  int worst_link(Stages& stages) {
    detail::WorstLink<Real> worst;
    sweep_inward(stages);
    sweep_outward(stages, [&](int i, const L& change) { worst.see(i, detail::StageChange<S, L>::largest_of(change)); });
    return worst.link();
  }

 private:
  using L = typename Stages::L;
  using Vector = typename Stages::Vector;
  using Placed = typename Stages::Placed;
  static constexpr std::size_t D = Stages::D;

  // From the tip to the pivot: X and Z of every link, and the elimination of the multipliers.
  PENDULA_IN_REGISTERS void sweep_inward(Stages& stages) {
    int i = stages.links() - 1;
    Placed here = stages.place(i);
    Vector bond = scaled(L(-stages.constants(i).inverse_mass.value), here.pull);
    MultiplierRow<L> row;
    L beyond(Real(0));
    for (; i > 0; --i) {
      const Placed before = stages.place(i - 1);
      const L inverse_mass(stages.constants(i - 1).inverse_mass.value);
      const Vector bond_before = scaled(inverse_mass, difference(here.pull, before.pull));
      const L coupling = -(inverse_mass * dot(before.rod, here.rod));
      row = eliminate(stages, i, here, difference(bond, bond_before), row, beyond, coupling);
      bond = bond_before;
      beyond = coupling;
      here = before;
    }
    eliminate(stages, 0, here, bond, row, beyond, L(Real(0)));
  }

  MultiplierRow<L> eliminate(Stages& stages, int i, const Placed& here, const Vector& W, const MultiplierRow<L>& row,
                             const L& beyond, const L& before) {
    const Real* free = stages.rods().free(i);
    const Vector freed = stages.freed(i, W);
    L product(stages.rods().product(i)), moving(Real(0));  // X·Z = ξ·z, which is exact, + (X − ξ)·z + X·(Z − z)
    for (std::size_t k = 0; k < D; ++k) {
      moving = fma(here.moved[k], L(free[k]), moving);
      product = fma(here.rod[k], freed[k], product);
    }
    const L square = L(stages.constants(i).inverse_masses) * dot(here.rod, here.rod);
    const MultiplierRow<L> next = row.next(square, beyond, before, -(product + moving));
    stages.keep(i, here.rod, freed, next);
    return next;
  }

  // From the pivot to the tip: the multipliers, and the increments that they make; visit(i, their changes).
  template <class Visit>
  PENDULA_IN_REGISTERS Correction sweep_outward(Stages& stages, Visit visit) {
    const L hb = stages.columns().hb();
    detail::StageChange<S, L> change;
    L tau = stages.kept_row(0).offset;
    Vector rod = stages.kept_rod(0), here, bond_before;
    bond_before.fill(L(Real(0)));
    const int last = stages.links() - 1;
    for (int i = 0; i <= last; ++i) {
      here = rod;
      Vector pull = scaled(tau, rod);
      stages.set_multiplier(i, tau);
      if (i < last) {
        const MultiplierRow<L> next = stages.kept_row(i + 1);
        tau = next.offset - next.coupling * tau;
        rod = stages.kept_rod(i + 1);
        pull = difference(pull, scaled(tau, rod));
      }
      const Vector bond = scaled(L(stages.constants(i).inverse_mass.value), pull);
      const Vector freed = stages.kept_freed(i), old = stages.increments(i);
      Vector U, difference_to_old, advance;
      for (std::size_t k = 0; k < D; ++k) {
        U[k] = hb * (freed[k] + (bond[k] - bond_before[k]));
        advance[k] = fma(hb, L(stages.rods().free(i)[k]), U[k]);
        difference_to_old[k] = U[k] - old[k];
      }
      visit(i, change.add(here, difference_to_old, advance, stages.constants(i).inverse_square));
      stages.set_increments(i, U);
      bond_before = bond;
    }
    stages.set_turn(change.turn());
    return {change.relative(), -1};
  }
};

}  // namespace pendula
