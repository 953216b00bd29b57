#pragma once

#include <cmath>
#include <limits>
#include <pendula/gauss/chain_stages.hpp>
#include <pendula/gauss/stepper.hpp>

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
    int worst = -1;
    Real largest(0);
    sweep_inward(stages);
    sweep_outward(stages, [&](int i, const L& change) {
      const Real here = over_stages(change, [](const Real& x, const Real& y) { return x >= y ? x : y; });
      if (here <= largest || (worst >= 0 && !std::isfinite(static_cast<double>(largest)))) return;
      largest = here;
      worst = i;
    });
    return worst;
  }

 private:
  using L = typename Stages::L;
  using Vector = typename Stages::Vector;
  using Placed = typename Stages::Placed;
  static constexpr std::size_t D = Stages::D, Z = Stages::Z;

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
    L product(stages.rods().product(i));  // X·Z, of which ξ·z is exact
    for (std::size_t k = 0; k < D; ++k) {
      product = fma(here.rod[k], freed[k], fma(here.moved[k], L(free[k]), product));
    }
    const L square = L(stages.constants(i).inverse_masses) * dot(here.rod, here.rod);
    const MultiplierRow<L> next = row.next(square, beyond, before, -product);
    stages.keep(i, here.rod, freed, next);
    return next;
  }

  // From the pivot to the tip: the multipliers, and the increments that they make; visit(i, their changes).
  template <class Visit>
  PENDULA_IN_REGISTERS Correction sweep_outward(Stages& stages, Visit visit) {
    const L hb = stages.columns().hb();
    L change(Real(0)), scale(Real(0)), all(Real(0));
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
      const L inverse_square(stages.constants(i).inverse_square);
      Vector U, difference_to_old, advance;
      for (std::size_t k = 0; k < D; ++k) {
        U[k] = hb * (freed[k] + (bond[k] - bond_before[k]));
        advance[k] = fma(hb, L(stages.rods().free(i)[k]), U[k]);
        difference_to_old[k] = U[k] - old[k];
        all = all + U[k];
      }
      const L changed = largest_across(here, difference_to_old) * inverse_square;
      scale = max(scale, largest_across(here, advance) * inverse_square);
      change = max(change, changed);
      visit(i, changed);
      stages.set_increments(i, U);
      bond_before = bond;
    }
    stages.set_turn(static_cast<double>(over_stages(scale, [](const Real& x, const Real& y) { return Real(x + y); })));
    return {relative(change, scale, all), -1};
  }

  // What is not a number reaches the sum of all, though not always the largest change.
  static double relative(const L& change, const L& scale, const L& all) {
    const auto plus = [](const Real& x, const Real& y) { return Real(x + y); };
    const auto larger = [](const Real& x, const Real& y) { return x > y ? x : y; };
    if (!std::isfinite(static_cast<double>(over_stages(all, plus)))) return std::numeric_limits<double>::quiet_NaN();
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
};

}  // namespace pendula
