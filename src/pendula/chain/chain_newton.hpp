#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain_elimination.hpp>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/chain/stage_change.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/numeric/block.hpp>
#include <pendula/system/stop_sign.hpp>
#include <vector>

namespace pendula {

/// One exact Newton iteration on all s stages of a chain at once, in O(n (d s)³) for dimension d.
///
/// chain_elimination.hpp has the stage equations, and the blocks of a link in them. The slip is X·V here.
/// Multipliers follow from E₂ τ = X̂·(G − H f(τ = 0)). Inward, with δG_{i+1} = P δw_i + g from the link below and
/// B = P + m I:
///   S = L (B − N) Z,  K = −S⁻¹ L B,  k = −S⁻¹ L ((B − N) v₀ + g − q),  P ← B + B Z K,  g ← g + B (v₀ + Z k),
/// and outward δV = v₀ + Z (k + K δw_{i−1}), δw_i = δw_{i−1} + δV. At h = 0 this is the articulated-body recursion.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainNewton : private ChainElimination<Space, S, N, Real, Arch> {
  using Base = ChainElimination<Space, S, N, Real, Arch>;

 public:
  using Stages = ChainStages<Space, S, N, Real, Arch>;

  /// Most links whose gains are kept: those of a long chain would take more memory than everything else. Gains of other
  /// links are computed a second time, to the same bits, when the sweep outward reaches them.
  static constexpr int most_kept = 4096;

  explicit ChainNewton(int links, int kept = most_kept)
      : block_(kept), gains_(std::min(links, kept)), below_(static_cast<std::size_t>(std::max(links - 1, 0) / kept)) {}

  /// From now on asks `stop` after every `most_kept` links. The result of an iteration that it ends is useless.
  void set_stop_sign(StopSign stop) { stop_ = stop; }

  /// Improves increments and multipliers once.
  Correction correct(Stages& stages) {
    set_coefficients(stages.columns());
    run_out(stages);
    inward(stages);
    return outward(stages);
  }

  /// The link that one more Newton iteration changes most.
  int worst_link(Stages& stages) {
    detail::WorstLink<Real> worst;
    set_coefficients(stages.columns());
    run_out(stages);
    inward(stages);
    outward(stages, &worst);
    return worst.link();
  }

  /// Computes the multipliers that belong to the present increments.
  PENDULA_IN_REGISTERS void find_multipliers(Stages& stages) {
    set_coefficients(stages.columns());
    run_out(stages);
    Vector G = zero();
    for (int i = stages.links(); i-- > 0;) {
      G = sum(G, scaled(L(stages.constants(i).mass), stages.kept_gain(i)));
      Terms terms;
      terms.slip[0] = set_directions(stages, i, stages.kept_rod(i), terms);
      find_multiplier(stages, i, G, terms);
    }
  }

  /// Whether all pivots of the last iteration were positive, as they are near the start of the step.
  bool positive() const { return positive_; }

 private:
  using Base::D, Base::Lanes, Base::s, Base::unknowns, Base::vectors;
  using Base::inverse_hb_, Base::positive_;
  using Base::zero, Base::set_coefficients, Base::set_directions, Base::find_inverse, Base::find_null_space,
      Base::find_annihilator, Base::subtract_own;
  using typename Base::L, typename Base::Vector, typename Base::PerStage;
  template <std::size_t Rows, std::size_t Columns>
  using Block = detail::Block<Rows, Columns, Real>;
  using Tangents = Block<vectors, unknowns + 1>;  // Z, and v₀ in the last column

  struct Terms : Base::Terms {
    PerStage residual[D], slip[1];
  };

  struct CarriedMomentum {  // δG = P δw + g, and G
    Block<vectors, vectors> P;
    Real g[vectors] = {};
    Vector G = zero();
  };

  struct Gain {  // δV = v₀ + Z (K δw + k)
    Tangents Z;
    Block<unknowns, vectors> K{};
    Real k[unknowns] = {};
  };

  // Places the rods at the stages, and keeps the changes of the bobs' velocities since the start of the step.
  PENDULA_IN_REGISTERS void run_out(Stages& stages) {
    Vector w = zero();
    for (int i = 0; i < stages.links(); ++i) {
      const Vector X = stages.place(i), U = stages.increments(i);
      for (std::size_t d = 0; d < D; ++d) w[d] = fma(U[d], inverse_hb_.lanes(), w[d]);
      stages.set_kept(i, X, w);
    }
  }

  // The sweep from the tip to the pivot. It adds the mass of the next bob to the diagonal of P one link early, where no
  // operation has to wait for it.
  PENDULA_IN_REGISTERS void inward(Stages& stages) {
    positive_ = true;
    CarriedMomentum carried;
    const int last = stages.links() - 1;
    for (std::size_t k = 0; k < vectors; ++k) carried.P.set_row(k, carried.P.unit(k, stages.constants(last).mass));
    for (int end = stages.links(); end > 0 && !stop_();) {
      const int begin = (end - 1) / block_ * block_;
      if (begin > 0) below_[static_cast<std::size_t>(begin / block_ - 1)] = carried;
      inward(stages, begin, end, carried);
      end = begin;
    }
  }

  PENDULA_IN_REGISTERS [[gnu::noinline]] void inward(Stages& stages, int begin, int end, CarriedMomentum& carried) {
    Vector G = carried.G;
    Terms terms;
    for (int i = end; i-- > begin;) {
      G = sum(G, scaled(L(stages.constants(i).mass), stages.kept_gain(i)));
      terms.slip[0] = set_directions(stages, i, stages.kept_rod(i), terms);
      find_multiplier(stages, i, G, terms);
      eliminate(stages, i, terms, carried, gains_[i - begin]);
    }
    carried.G = G;
  }

  // Finds τ, −E₂⁻¹ and the residual q.
  void find_multiplier(Stages& stages, int i, const Vector& G, Terms& terms) {
    find_inverse(terms);
    const Vector pushed = stages.impulse_without_multiplier(i, stages.kept_rod(i));
    L along(Real(0));
    for (std::size_t d = 0; d < D; ++d) along = fma(terms.dual[d].lanes(), G[d] - pushed[d], along);
    PerStage right;
    right = -along;
    terms.tau = L(Real(0));
    for (std::size_t k = 0; k < s; ++k) {
      Real tau(0);
      for (std::size_t j = 0; j < s; ++j) tau += terms.inverse[k][j] * right[j];
      terms.tau.values[k] = tau;
    }
    const L tau = terms.tau.lanes();
    stages.set_multiplier(i, tau);
    const Vector advance = stages.advance(i);
    for (std::size_t d = 0; d < D; ++d) {
      const L pulled = stages.columns().integral(tau * advance[d]);
      terms.residual[d] = fma(tau, terms.rod[d].lanes(), (pushed[d] - G[d]) - pulled);
    }
  }

  // Nothing moves before the first link; below the last one there is its own bob, P = m I.
  void eliminate(const Stages& stages, int i, const Terms& terms, CarriedMomentum& carried, Gain& gain) {
    const bool first = i == 0, last = i + 1 == stages.links();
    Tangents BZ, own;
    Block<unknowns, vectors> across;       // L
    Block<unknowns, unknowns + 1> pivots;  // S, and the right-hand side of k
    find_null_space(terms, terms.slip, gain.Z);
    find_annihilator(terms, across);
    last ? set_scaled(carried.P[0][0], gain.Z, BZ) : set_product(carried.P, gain.Z, BZ);
    subtract_own(stages, i, terms, gain.Z, BZ, own);
    for (std::size_t u = 0; u < vectors; ++u) {
      const Real rest = carried.g[u] - terms.residual[u / s][u % s];
      own.set_row(u, own.row(u) + Tangents::unit(unknowns, rest));
    }
    set_product(across, own, pivots);
    if (first) {
      positive_ = detail::solve_negated(pivots) && positive_;
    } else {
      last ? set_scaled(carried.P[0][0], across, gain.K) : set_product(across, carried.P, gain.K);
      positive_ = detail::solve_negated(pivots, gain.K) && positive_;
    }
    for (std::size_t u = 0; u < unknowns; ++u) gain.k[u] = pivots[u][unknowns];
    if (!first) hand_on(BZ, gain, stages.constants(i - 1).mass, carried);
  }

  // P ← B + B Z K with the mass of the bob before on its diagonal, g ← g + B (v₀ + Z k).
  static void hand_on(const Tangents& BZ, const Gain& gain, const Real& mass_before, CarriedMomentum& carried) {
    using Row = typename Block<vectors, vectors>::Row;
    for (std::size_t u = 0; u < vectors; ++u) {
      Row row = carried.P.row(u) + carried.P.unit(u, mass_before);
      Real rest = carried.g[u] + BZ[u][unknowns];
      for (std::size_t v = 0; v < unknowns; ++v) {
        row = fma(Row(BZ[u][v]), gain.K.row(v), row);
        rest += BZ[u][v] * gain.k[v];
      }
      carried.P.set_row(u, row);
      carried.g[u] = rest;
    }
  }

  // The sweep from the pivot to the tip, which changes all stages. It computes with single numbers, not in lanes, so
  // that a link waits less for the one before.
  PENDULA_IN_REGISTERS Correction outward(Stages& stages, detail::WorstLink<Real>* worst = nullptr) {
    Real dw[vectors] = {};
    detail::StageChange<S, L> change;
    for (int begin = 0; begin < stages.links() && !stop_(); begin += block_) {
      const int end = std::min(begin + block_, stages.links());
      if (begin > 0) {
        CarriedMomentum again = below_[static_cast<std::size_t>(begin / block_ - 1)];
        inward(stages, begin, end, again);
      }
      outward(stages, begin, end, dw, change, worst);
    }
    return {change.relative(), -1};
  }

  PENDULA_IN_REGISTERS void outward(Stages& stages, int begin, int end, Real (&dw)[vectors],
                                    detail::StageChange<S, L>& change, detail::WorstLink<Real>* worst) {
    const auto& columns = stages.columns();
    for (int i = begin; i < end; ++i) {
      alignas(pack_alignment) Real dV[D][Lanes] = {};
      stage_changes(gains_[i - begin], dw, dV);
      Vector U = stages.increments(i), dU;
      for (std::size_t d = 0; d < D; ++d) {
        for (std::size_t k = 0; k < s; ++k) dw[d * s + k] += dV[d][k];
        dU[d] = columns.hb() * L::load(dV[d]);
        U[d] = U[d] + dU[d];
      }
      stages.set_increments(i, U);
      const L turned = change.add(stages.kept_rod(i), dU, stages.advance(i), stages.constants(i).inverse_square);
      if (worst != nullptr) worst->see(i, detail::StageChange<S, L>::largest_of(turned));
    }
  }

  static void stage_changes(const Gain& gain, const Real* dw, Real (&dV)[D][Lanes]) {
    Real alpha[unknowns];
    for (std::size_t u = 0; u < unknowns; ++u) {
      Real even = gain.k[u], odd(0);
      for (std::size_t k = 0; k + 1 < vectors; k += 2) {
        even += gain.K[u][k] * dw[k];
        odd += gain.K[u][k + 1] * dw[k + 1];
      }
      if (vectors % 2 == 1) even += gain.K[u][vectors - 1] * dw[vectors - 1];
      alpha[u] = even + odd;
    }
    for (std::size_t v = 0; v < vectors; ++v) {
      Real change = gain.Z[v][unknowns];
      for (std::size_t u = 0; u < unknowns; ++u) change += gain.Z[v][u] * alpha[u];
      dV[v / s][v % s] = change;
    }
  }

  StopSign stop_;
  int block_;
  detail::PerLink<Gain, N> gains_;      // of one block
  std::vector<CarriedMomentum> below_;  // from each block but the first to the one before
};

}  // namespace pendula
