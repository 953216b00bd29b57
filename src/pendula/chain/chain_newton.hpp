#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/chain/stage_change.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/numeric/block.hpp>

namespace pendula {

/// One exact Newton iteration on all stages of a chain at once, in O(n (d s)³) for dimension d.
///
/// Unknown are the stage velocities V of the rods, at every stage across its rod X. With H_kj = h a_kj, X̂ = X/|X|² and
/// u = V − z, momenta enter as what they gain in the step, G_i = Σ_{j≥i} m_j Σ_{k≤j} u_k, and stage k of link i asks
/// for
///   q(k) = Σ_j H_kj f(j) + τ(k) X(k) − G(k) = 0,  f = −τ V − (λ/l²) V + (torque × X)/l² − M g up.
/// Stacked over the stages, t_b(k) the d − 1 tangents of X(k):
///   E[k,j] = δ + H_kj V(k)·X̂(j),  E₂[k,j] = δ − H_kj X̂(k)·V(j)           (s x s, the identity at h = 0)
///   W_b[k,j] = H_kj V(k)·t_b(j),  F_b[k,j] = H_kj t_b(k)·V(j)
///   Z = T − X̂ E⁻¹ W,  v₀ = −X̂ E⁻¹ (X·V)                                  changes of V that keep X·V = 0: v₀ + Z α
///   L = Tᵀ + F E₂⁻¹ X̂ᵀ                                                    what of q no multiplier changes
///   N = τ H − H τ − (λ/l²) H + H (torque/l² ×) H − (M |g|/l) H²             ∂q/∂V at fixed τ and G
/// where the last term is that of steps which do not resolve the chain's swinging.
/// Multipliers follow from E₂ τ = X̂·(G − H f(τ = 0)). Inward, with δG_{i+1} = P δw_i + g from the link below and
/// B = P + m I:
///   S = L (B − N) Z,  K = −S⁻¹ L B,  k = −S⁻¹ L ((B − N) v₀ + g − q),  P ← B + B Z K,  g ← g + B (v₀ + Z k),
/// and outward δV = v₀ + Z (k + K δw_{i−1}), δw_i = δw_{i−1} + δV. At h = 0 this is the articulated-body recursion.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainNewton {
 public:
  using Stages = ChainStages<Space, S, N, Real, Arch>;

  explicit ChainNewton(int links) : gains_(links) {
    for (std::size_t k = 0; k < s; ++k) unit_[k].values[k] = Real(1);
  }

  /// Improves increments and multipliers once.
  Correction correct(Stages& stages) {
    set_coefficients(stages.columns());
    run_out(stages);
    inward(stages);
    return outward(stages, [](int, const L&) {});
  }

  /// The link where one more iteration changes most.
  int worst_link(Stages& stages) {
    detail::WorstLink<Real> worst;
    set_coefficients(stages.columns());
    run_out(stages);
    inward(stages);
    outward(stages, [&](int i, const L& change) { worst.see(i, detail::StageChange<S, L>::largest_of(change)); });
    return worst.link();
  }

  /// The multipliers that belong to the increments as they are.
  PENDULA_IN_REGISTERS void find_multipliers(Stages& stages) {
    set_coefficients(stages.columns());
    run_out(stages);
    Vector G = zero();
    for (int i = stages.links(); i-- > 0;) {
      G = sum(G, scaled(L(stages.constants(i).mass), stages.kept_freed(i)));
      Terms terms;
      find_directions(stages, i, terms);
      find_multiplier(stages, i, G, terms);
    }
  }

  /// Whether all pivots of the last iteration were positive, as they are near the start of the step.
  bool positive() const { return positive_; }

 private:
  using L = typename Stages::L;
  using Vector = typename Stages::Vector;
  static constexpr std::size_t D = Stages::D, Lanes = Stages::Z, s = S;
  static constexpr std::size_t tangents = D - 1, unknowns = tangents * s, vectors = D * s;

  template <std::size_t Rows, std::size_t Columns>
  using Block = detail::Block<Rows, Columns, Real>;
  using Tangents = Block<vectors, unknowns + 1>;  // Z, and v₀ in the last column

  // A number at every stage, from which the blocks are made.
  struct alignas(pack_alignment) PerStage {
    Real values[Lanes];
    PerStage& operator=(const L& lanes) {
      lanes.store(values);
      return *this;
    }
    Real operator[](std::size_t stage) const { return values[stage]; }
    L lanes() const { return L::load(values); }
  };

  struct Terms {
    PerStage rod[D], velocity[D], dual[D];  // X, V, X̂
    PerStage tangent[tangents][D];
    PerStage tau, residual[D], slip;  // slip: X·V
    Block<s, s> inverse;              // −E₂⁻¹
  };

  struct Carried {  // δG = P δw + g
    Block<vectors, vectors> P;
    Real g[vectors] = {};
  };

  struct Gain {  // δV = v₀ + Z (K δw + k)
    Tangents Z;
    Block<unknowns, vectors> K{};
    Real k[unknowns] = {};
  };

  static Vector zero() {
    return components<D>([](std::size_t) { return L(Real(0)); });
  }

  void set_coefficients(const detail::StageColumns<S, Real>& columns) {
    if (columns.h() == h_ && is_set_) return;
    h_ = columns.h();
    is_set_ = true;
    inverse_hb_ = L(Real(0));
    for (std::size_t k = 0; k < s; ++k) {
      inverse_hb_.values[k] = h_ == 0 ? Real(0) : Real(1 / columns.hb(k));
      for (std::size_t j = 0; j < s; ++j) ha_[k].values[j] = columns.ha(k, j);
    }
    for (std::size_t k = 0; k < s; ++k) {
      L row(Real(0));
      for (std::size_t j = 0; j < s; ++j) row = fma(L(ha_[k][j]), ha_[j].lanes(), row);
      ha_squared_[k] = row;
    }
  }

  // Places the rods, and leaves what the bobs' velocities have gained since the start of the step.
  PENDULA_IN_REGISTERS void run_out(Stages& stages) {
    Vector w = zero();
    for (int i = 0; i < stages.links(); ++i) {
      const Vector X = stages.place(i).rod, U = stages.increments(i);
      for (std::size_t d = 0; d < D; ++d) w[d] = fma(U[d], inverse_hb_.lanes(), w[d]);
      stages.keep(i, X, w, {});
    }
  }

  // Carries the mass of the bob to come on the diagonal of P, where nothing has to wait for it.
  PENDULA_IN_REGISTERS void inward(Stages& stages) {
    positive_ = true;
    Carried carried;
    Vector G = zero();
    Terms terms;
    const int last = stages.links() - 1;
    for (std::size_t k = 0; k < vectors; ++k) carried.P.set_row(k, carried.P.unit(k, stages.constants(last).mass));
    for (int i = last; i >= 0; --i) {
      G = sum(G, scaled(L(stages.constants(i).mass), stages.kept_freed(i)));
      find_directions(stages, i, terms);
      find_multiplier(stages, i, G, terms);
      eliminate(stages, i, terms, carried);
    }
  }

  void find_directions(const Stages& stages, int i, Terms& terms) const {
    const Vector X = stages.kept_rod(i), U = stages.increments(i);
    const Real* free = stages.rods().free(i);
    const L inverse_square = L(Real(1)) / dot(X, X);
    L slip(Real(0));
    for (std::size_t d = 0; d < D; ++d) {
      const L V = fma(U[d], inverse_hb_.lanes(), L(free[d]));
      slip = fma(X[d], V, slip);
      terms.rod[d] = X[d];
      terms.velocity[d] = V;
      terms.dual[d] = X[d] * inverse_square;
    }
    terms.slip = slip;
    set_tangents(terms);
  }

  // Across X in the plane of an axis a and each other one, X_a the largest component: independent everywhere.
  static void set_tangents(Terms& terms) {
    if constexpr (D == 2) {
      terms.tangent[0][0] = -terms.rod[1].lanes();
      terms.tangent[0][1] = terms.rod[0].lanes();
    } else {
      using std::abs;
      for (std::size_t k = 0; k < Lanes; ++k) {
        std::size_t a = 0;
        for (std::size_t d = 1; d < D; ++d) {
          if (abs(terms.rod[d][k]) > abs(terms.rod[a][k])) a = d;
        }
        for (std::size_t b = 0; b < tangents; ++b) {
          const std::size_t other = (a + 1 + b) % D, third = (a + 2 - b) % D;
          terms.tangent[b][other].values[k] = terms.rod[a][k];
          terms.tangent[b][a].values[k] = -terms.rod[other][k];
          terms.tangent[b][third].values[k] = Real(0);
        }
      }
    }
  }

  // Σ_d x_d(k) y_d at all stages, times h a_k.
  L coupling(std::size_t k, const PerStage (&x)[D], const PerStage (&y)[D]) const {
    L sum = L(x[0][k]) * y[0].lanes();
    for (std::size_t d = 1; d < D; ++d) sum = fma(L(x[d][k]), y[d].lanes(), sum);
    return ha_[k].lanes() * sum;
  }

  // τ, −E₂⁻¹ and the residual q.
  void find_multiplier(Stages& stages, int i, const Vector& G, Terms& terms) {
    Block<s, s> E2;
    for (std::size_t k = 0; k < s; ++k) {
      set_stages(E2, k, 0, unit_[k].lanes() - coupling(k, terms.dual, terms.velocity));
      set_stages(terms.inverse, k, 0, unit_[k].lanes());
    }
    positive_ = detail::solve_negated(E2, terms.inverse) && positive_;
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
  void eliminate(const Stages& stages, int i, const Terms& terms, Carried& carried) {
    const bool first = i == 0, last = i + 1 == stages.links();
    Gain& gain = gains_[i];
    Tangents BZ, own;
    Block<unknowns, vectors> across;       // L
    Block<unknowns, unknowns + 1> pivots;  // S, and what k is made of
    find_null_space(terms, gain.Z);
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
  static void hand_on(const Tangents& BZ, const Gain& gain, const Real& mass_before, Carried& carried) {
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

  // Z = T − X̂ E⁻¹ W, and v₀ = −X̂ E⁻¹ (X·V).
  void find_null_space(const Terms& terms, Tangents& Z) {
    Block<s, s> E;
    Block<s, unknowns + 1> W;
    using Row = typename Tangents::Row;
    for (std::size_t k = 0; k < s; ++k) {
      set_stages(E, k, 0, unit_[k].lanes() + coupling(k, terms.velocity, terms.dual));
      W.set_row(k, Row(Real(0)));
      for (std::size_t b = 0; b < tangents; ++b) {
        set_stages(W, k, b * s, coupling(k, terms.velocity, terms.tangent[b]));
      }
      W[k][unknowns] = terms.slip[k];
    }
    positive_ = detail::solve_negated(E, W) && positive_;
    for (std::size_t d = 0; d < D; ++d) {
      for (std::size_t k = 0; k < s; ++k) {
        Row row = Row(terms.dual[d].values[k]) * W.row(k);
        for (std::size_t b = 0; b < tangents; ++b) row = row + Tangents::unit(b * s + k, terms.tangent[b][d][k]);
        Z.set_row(d * s + k, row);
      }
    }
  }

  // L = Tᵀ + F E₂⁻¹ X̂ᵀ.
  void find_annihilator(const Terms& terms, Block<unknowns, vectors>& across) const {
    for (std::size_t b = 0; b < tangents; ++b) {
      for (std::size_t k = 0; k < s; ++k) {
        PerStage F;
        F = coupling(k, terms.tangent[b], terms.velocity);
        L through(Real(0));  // −F E₂⁻¹
        for (std::size_t j = 0; j < s; ++j) through = fma(L(F[j]), stages_of(terms.inverse, j), through);
        const std::size_t u = b * s + k;
        if (Block<unknowns, vectors>::stride > vectors) across.set_row(u, across.unit(0, Real(0)));
        for (std::size_t d = 0; d < D; ++d) {
          const L own = unit_[k].lanes() * L(terms.tangent[b][d][k]);
          set_stages(across, u, d * s, own - through * terms.dual[d].lanes());
        }
      }
    }
  }

  // own ← BZ − N Z.
  void subtract_own(const Stages& stages, int i, const Terms& terms, const Tangents& Z, const Tangents& BZ,
                    Tangents& own) const {
    const Real drag = stages.constants(i).drag, hanging = stages.hanging(i);
    for (std::size_t k = 0; k < s; ++k) {
      Real minus[s];
      for (std::size_t j = 0; j < s; ++j) {
        minus[j] = ha_[k][j] * (terms.tau[j] + drag - terms.tau[k]) + hanging * ha_squared_[k][j];
      }
      for (std::size_t d = 0; d < D; ++d) {
        own.set_row(d * s + k, row_of_product<s>(minus, Z, d * s, BZ.row(d * s + k)));
      }
    }
    if (stages.loaded()) subtract_torque(stages, i, Z, own);
  }

  // Σ_j a_j times row (begin + j) of B, added to `start`.
  template <std::size_t Count, class B>
  static typename B::Row row_of_product(const Real* a, const B& b, std::size_t begin, typename B::Row start) {
    for (std::size_t j = 0; j < Count; ++j) start = fma(typename B::Row(a[j]), b.row(begin + j), start);
    return start;
  }

  // The torque's part of N: H (torque/l² ×) H.
  void subtract_torque(const Stages& stages, int i, const Tangents& Z, Tangents& own) const {
    using Row = typename Tangents::Row;
    for (std::size_t e = 0; e < D; ++e) {
      Vector axis = zero(), turned;
      axis[e] = L(Real(1));
      Space::Link::torque_load(stages.torque(i), axis, turned);
      Block<s, unknowns + 1> HZ;
      for (std::size_t j = 0; j < s; ++j) HZ.set_row(j, row_of_product<s>(ha_[j].values, Z, e * s, Row(Real(0))));
      for (std::size_t d = 0; d < D; ++d) {
        PerStage torque;  // times h b
        torque = turned[d];
        for (std::size_t k = 0; k < s; ++k) {
          Real minus[s];
          for (std::size_t j = 0; j < s; ++j) minus[j] = -stages.columns().m(k, j) * torque[j];
          own.set_row(d * s + k, row_of_product<s>(minus, HZ, 0, own.row(d * s + k)));
        }
      }
    }
  }

  // The stages of a pack in a row from a column on: whole where there is room for what stands behind the last stage,
  // which the columns after overwrite.
  template <class B>
  static void set_stages(B& block, std::size_t row, std::size_t column, const L& lanes) {
    if (Lanes == s || column + Lanes <= B::stride) {
      lanes.store_unaligned(block[row] + column);
    } else {
      PerStage stored;
      stored = lanes;
      std::copy_n(stored.values, s, block[row] + column);
    }
  }
  static L stages_of(const Block<s, s>& block, std::size_t row) {
    static_assert(Block<s, s>::stride == Lanes);
    return L::load(block[row]);
  }

  // From the pivot to the tip: the changes of all stages; visit(i, what they turn rod i). Number by number, not in
  // lanes: what a link waits for is short then.
  template <class Visit>
  PENDULA_IN_REGISTERS Correction outward(Stages& stages, Visit visit) {
    const auto& columns = stages.columns();
    Real dw[vectors] = {};
    detail::StageChange<S, L> change;
    for (int i = 0; i < stages.links(); ++i) {
      alignas(pack_alignment) Real dV[D][Lanes] = {};
      stage_changes(gains_[i], dw, dV);
      Vector U = stages.increments(i), dU;
      for (std::size_t d = 0; d < D; ++d) {
        for (std::size_t k = 0; k < s; ++k) dw[d * s + k] += dV[d][k];
        dU[d] = columns.hb() * L::load(dV[d]);
        U[d] = U[d] + dU[d];
      }
      stages.set_increments(i, U);
      visit(i, change.add(stages.kept_rod(i), dU, stages.advance(i), stages.constants(i).inverse_square));
    }
    stages.set_turn(change.turn());
    return {change.relative(), -1};
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

  detail::PerLink<Gain, N> gains_;
  PerStage ha_[s]{}, ha_squared_[s]{}, unit_[s]{};  // of k: h a_kj, Σ_i h a_ki h a_ij, δ_kj
  PerStage inverse_hb_{};                           // 1/(h b), of a step of no length zero
  Real h_{0};                                       // that all of them are for
  bool is_set_ = false, positive_ = true;
};

}  // namespace pendula
