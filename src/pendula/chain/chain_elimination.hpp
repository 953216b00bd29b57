#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/numeric/block.hpp>

namespace pendula {

/// The common base of Newton and of the tangent of a step: the blocks of one link in the linearised stage equations.
///
/// Unknowns are the stage velocities V of the rods, at every stage across its rod X. With H_kj = h a_kj, X̂ = X/|X|² and
/// u = V − z, momenta enter by their change in the step, G_i = Σ_{j≥i} m_j Σ_{k≤j} u_k, and the equation of stage k of
/// link i is
///   q(k) = Σ_j H_kj f(j) + τ(k) X(k) − G(k) = 0,  f = −τ V − (λ/l²) V + (torque × X)/l² − M g up.
/// Stacked over the stages, t_b(k) the d − 1 tangents of X(k):
///   E[k,j] = δ + H_kj V(k)·X̂(j),  E₂[k,j] = δ − H_kj X̂(k)·V(j)           (s x s, the identity at h = 0)
///   W_b[k,j] = H_kj V(k)·t_b(j),  F_b[k,j] = H_kj t_b(k)·V(j)
///   Z = T − X̂ E⁻¹ W,  v₀ = −X̂ E⁻¹ slip                                   changes of V that keep X·V but for −slip
///   L = Tᵀ + F E₂⁻¹ X̂ᵀ                                                    the part of q that no multiplier changes
///   N = τ H − H τ − (λ/l²) H + H (torque/l² ×) H − (M |g|/l) H²             ∂q/∂V at fixed τ and G
/// where the last term is zero, except in steps that do not resolve the chain's swinging.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainElimination {
 protected:
  using Stages = ChainStages<Space, S, N, Real, Arch>;
  using L = typename Stages::L;
  using Vector = typename Stages::Vector;
  static constexpr std::size_t D = Stages::D, Lanes = Stages::Z, s = S;
  static constexpr std::size_t turns = D - 1, unknowns = turns * s, vectors = D * s;

  template <std::size_t Rows, std::size_t Columns>
  using Block = detail::Block<Rows, Columns, Real>;

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
    PerStage tangent[turns][D];
    PerStage tau;
    Block<s, s> inverse;  // −E₂⁻¹
  };

  ChainElimination() {
    for (std::size_t k = 0; k < s; ++k) unit_[k].values[k] = Real(1);
  }

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

  // Sets X, V, X̂ and the tangents of link i with its rod at X. Returns X·V.
  L set_directions(const Stages& stages, int i, const Vector& X, Terms& terms) const {
    const Vector U = stages.increments(i);
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
    set_tangents(terms);
    return slip;
  }

  // Σ_d x_d(k) y_d at all stages, times h a_k.
  L coupling(std::size_t k, const PerStage (&x)[D], const PerStage (&y)[D]) const {
    L sum = L(x[0][k]) * y[0].lanes();
    for (std::size_t d = 1; d < D; ++d) sum = fma(L(x[d][k]), y[d].lanes(), sum);
    return ha_[k].lanes() * sum;
  }

  void find_inverse(Terms& terms) {
    Block<s, s> E2;
    for (std::size_t k = 0; k < s; ++k) {
      set_stages(E2, k, 0, unit_[k].lanes() - coupling(k, terms.dual, terms.velocity));
      set_stages(terms.inverse, k, 0, unit_[k].lanes());
    }
    positive_ = detail::solve_negated(E2, terms.inverse) && positive_;
  }

  // Z = T − X̂ E⁻¹ W, and after it v₀ = −X̂ E⁻¹ slip, a column for each slip: the error of X·V at the stages.
  template <std::size_t Slips>
  void find_null_space(const Terms& terms, const PerStage (&slips)[Slips], Block<vectors, unknowns + Slips>& Z) {
    Block<s, s> E;
    Block<s, unknowns + Slips> W;
    using Changes = Block<vectors, unknowns + Slips>;
    using Row = typename Changes::Row;
    for (std::size_t k = 0; k < s; ++k) {
      set_stages(E, k, 0, unit_[k].lanes() + coupling(k, terms.velocity, terms.dual));
      W.set_row(k, Row(Real(0)));
      for (std::size_t b = 0; b < turns; ++b) {
        set_stages(W, k, b * s, coupling(k, terms.velocity, terms.tangent[b]));
      }
      for (std::size_t e = 0; e < Slips; ++e) W[k][unknowns + e] = slips[e][k];
    }
    positive_ = detail::solve_negated(E, W) && positive_;
    for (std::size_t d = 0; d < D; ++d) {
      for (std::size_t k = 0; k < s; ++k) {
        Row row = Row(terms.dual[d].values[k]) * W.row(k);
        for (std::size_t b = 0; b < turns; ++b) row = row + Changes::unit(b * s + k, terms.tangent[b][d][k]);
        Z.set_row(d * s + k, row);
      }
    }
  }

  // L = Tᵀ + F E₂⁻¹ X̂ᵀ.
  void find_annihilator(const Terms& terms, Block<unknowns, vectors>& across) const {
    for (std::size_t b = 0; b < turns; ++b) {
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
  template <std::size_t Columns>
  void subtract_own(const Stages& stages, int i, const Terms& terms, const Block<vectors, Columns>& Z,
                    const Block<vectors, Columns>& BZ, Block<vectors, Columns>& own) const {
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
  template <std::size_t Columns>
  void subtract_torque(const Stages& stages, int i, const Block<vectors, Columns>& Z,
                       Block<vectors, Columns>& own) const {
    using Row = typename Block<vectors, Columns>::Row;
    for (std::size_t e = 0; e < D; ++e) {
      Vector axis = zero(), turned;
      axis[e] = L(Real(1));
      Space::Link::torque_load(stages.torque(i), axis, turned);
      Block<s, Columns> HZ;
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

  // Writes the stages of a pack into a row, from a column on: the whole pack where there is room, since columns that
  // are written later overwrite the lanes behind the last stage.
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

  PerStage ha_[s]{}, ha_squared_[s]{}, unit_[s]{};  // of k: h a_kj, Σ_i h a_ki h a_ij, δ_kj
  PerStage inverse_hb_{};                           // 1/(h b); 0 in a step of length zero
  Real h_{0};                                       // the step size that all of these are for
  bool is_set_ = false, positive_ = true;

 private:
  // Sets tangents across X, each in the plane of the axis a with the largest |X_a| and another axis: so they are
  // linearly independent everywhere.
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
        for (std::size_t b = 0; b < turns; ++b) {
          const std::size_t other = (a + 1 + b) % D, third = (a + 2 - b) % D;
          terms.tangent[b][other].values[k] = terms.rod[a][k];
          terms.tangent[b][a].values[k] = -terms.rod[other][k];
          terms.tangent[b][third].values[k] = Real(0);
        }
      }
    }
  }
};

}  // namespace pendula
