#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/gauss/chain_stages.hpp>

namespace pendula {

namespace detail {

/// Numbers in a pack that holds a row of `count`: a power of two, or a multiple of four, where there are registers.
template <class Real>
constexpr std::size_t padded_row(std::size_t count) {
  if (!has_registers<Real>) return count;
  return count <= 2 ? count : (count + 3) / 4 * 4;
}

/// A small matrix, row by row, its rows padded to packs.
template <std::size_t Rows, std::size_t Columns, class Real>
struct Block {
  static constexpr std::size_t stride = padded_row<Real>(Columns);
  using Row = Pack<static_cast<int>(stride), RegisterFor<static_cast<int>(stride), Real>>;

  alignas(pack_alignment) Real values[Rows][stride] = {};

  Real* operator[](std::size_t row) { return values[row]; }
  const Real* operator[](std::size_t row) const { return values[row]; }
  Row row(std::size_t i) const { return Row::load(values[i]); }
  void set_row(std::size_t i, const Row& row) { row.store(values[i]); }
};

/// C += A B, row by row; two sums side by side, so that one does not wait for the other.
template <std::size_t M, std::size_t Inner, std::size_t Columns, class Real>
void add_product(const Block<M, Inner, Real>& a, const Block<Inner, Columns, Real>& b, Block<M, Columns, Real>& c) {
  using Row = typename Block<M, Columns, Real>::Row;
  for (std::size_t i = 0; i < M; ++i) {
    Row even = c.row(i), odd(Real(0));
    for (std::size_t k = 0; k + 1 < Inner; k += 2) {
      even = fma(Row(a[i][k]), b.row(k), even);
      odd = fma(Row(a[i][k + 1]), b.row(k + 1), odd);
    }
    if (Inner % 2 == 1) even = fma(Row(a[i][Inner - 1]), b.row(Inner - 1), even);
    c.set_row(i, even + odd);
  }
}

/// y += A x.
template <std::size_t M, std::size_t Columns, class Real>
void add_product(const Block<M, Columns, Real>& a, const Real* x, Real* y) {
  for (std::size_t i = 0; i < M; ++i) {
    for (std::size_t k = 0; k < Columns; ++k) y[i] += a[i][k] * x[k];
  }
}

/// Replaces Y by −S⁻¹ Y and y by −S⁻¹ y. No pivoting: S is a mass matrix but for terms of the order of the step, and a
/// step that spoils it does not converge and is halved.
template <std::size_t M, std::size_t Columns, class Real>
void solve_negated(Block<M, M, Real>& S, Block<M, Columns, Real>& Y, Real* y) {
  using Row = typename Block<M, Columns, Real>::Row;
  for (std::size_t k = 0; k < M; ++k) {
    const Real inverse = 1 / S[k][k];
    S[k][k] = inverse;
    for (std::size_t i = k + 1; i < M; ++i) {
      const Real factor = -S[i][k] * inverse;
      for (std::size_t j = k + 1; j < M; ++j) S[i][j] += factor * S[k][j];
      Y.set_row(i, fma(Row(factor), Y.row(k), Y.row(i)));
      y[i] += factor * y[k];
    }
  }
  for (std::size_t k = M; k-- > 0;) {
    Row row = -Y.row(k);
    Real sum = -y[k];
    for (std::size_t j = k + 1; j < M; ++j) {
      row = fma(Row(-S[k][j]), Y.row(j), row);
      sum -= S[k][j] * y[j];
    }
    Y.set_row(k, Row(S[k][k]) * row);
    y[k] = S[k][k] * sum;
  }
}

}  // namespace detail

/// One exact Newton iteration on all stages of a chain at once, in O(n (d s)³) for dimension d.
///
/// Link i meets the rest of the chain through two vectors a stage: the velocity w of the bob before it, and the
/// momentum G below it. Stacked over the stages, with V the link's stage velocities (dof·s) and w, G (d·s):
///   δW = J δV,  J[(k), (m, a)] = l û_a δ_km + h a_km l y_a(k)      what V does to W = l û̇           (d s x dof s)
///   δr = E δG + D δV                                               what G and V do to the residual
///   E[(k, a), (j)] = l û_a δ_kj − h a_kj l y_a(j)                                                    (dof s x d s)
///   D[(k, a), (m, c)] = h a_km (T_ac(k) − T_ac(m) − ∂f_a/∂v_c) − h² Σ_j a_kj F_ac(j) a_jm            (dof s x dof s)
/// with y_a = Σ_b V_b û_ab, T_ac = l û_ac·G, F_ac = ∂f_a/∂q_c at fixed G, and ∂f/∂v that of damping. Inward, with
/// δG_{i+1} = P δw_i + g from the link below and B = P + m I:
///   S = D + E B J,  K = −S⁻¹ E B,  k = −S⁻¹ (r + E g),  P ← B + B J K,  g ← g + B J k,
/// and outward δV = k + K δw_{i−1}, δw_i = δw_{i−1} + J δV. At h = 0 this is the articulated-body recursion.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainNewton {
 public:
  using Stages = ChainStages<Space, S, N, Real, Arch>;

  explicit ChainNewton(int links) : gains_(links) {}

  /// Improves the stage velocities once.
  Correction correct(Stages& stages) {
    stages.place();
    stages.run_out();
    inward(stages);
    return outward(stages);
  }

 private:
  using Link = typename Space::Link;
  using L = typename Stages::L;
  using Coordinates = typename Stages::Coordinates;
  using Cartesian = typename Stages::Cartesian;
  static constexpr std::size_t K = Stages::K, Dim = Stages::D, Z = Stages::Z, s = S;
  static constexpr std::size_t unknowns = K * s, vectors = Dim * s;

  // A Newton term of every stage, where the blocks are made from.
  struct alignas(pack_alignment) PerStage {
    Real values[Z];
    PerStage& operator=(const L& lanes) {
      lanes.store(values);
      return *this;
    }
    Real operator[](std::size_t stage) const { return values[stage]; }
  };

  struct Terms {
    PerStage u[K][Dim], y[K][Dim];  // l û_a, l y_a along the axes of the world
    PerStage T[K][K], T_minus[K][K], F[K][K];
    PerStage residual[K];
  };

  struct Carried {  // δG = P δw + g
    detail::Block<vectors, vectors, Real> P;
    alignas(pack_alignment) Real g[vectors] = {};
  };

  struct Gain {  // δV = K δw + k
    detail::Block<unknowns, vectors, Real> K;
    alignas(pack_alignment) Real k[unknowns] = {};
  };

  PENDULA_IN_REGISTERS void inward(Stages& stages) {
    Carried carried;
    Cartesian G;
    G.fill(L(Real(0)));
    Terms terms;
    for (int i = stages.links(); i-- > 0;) {
      const Real m = stages.constants(i).mass;
      G = sum(G, scaled(L(m), stages.bob_velocity(i)));
      for (std::size_t k = 0; k < vectors; ++k) carried.P[k][k] += m;
      find_terms(stages, i, G, terms);
      eliminate(stages, terms, carried, gains_[i]);
    }
  }

  void find_terms(Stages& stages, int i, const Cartesian& G, Terms& terms) {
    const L l(stages.constants(i).length);
    const Chart chart = stages.chart(i);
    const auto trig = stages.trig(i);
    const Coordinates v = stages.rates(i);
    const Cartesian load = stages.load(i, chart, trig, v);
    typename Link::template First<L> u, y;
    typename Link::template Symmetric<L> p_D_q, f_D_q;
    Coordinates p, f;
    Link::newton_terms(trig, v, to_chart(chart, scaled(l, G)), load, u, y, p, f, p_D_q, f_D_q);
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t k = 0; k < Dim; ++k) {
        const auto axis = static_cast<std::size_t>(world_axis<Space>(chart, static_cast<int>(k)));
        terms.u[a][axis] = l * u[a][k];
        terms.y[a][axis] = l * y[a][k];
      }
      for (std::size_t c = 0; c < K; ++c) {
        terms.T[a][c] = p_D_q[a + c];  // θθ, θφ, φφ
        terms.T_minus[a][c] = p_D_q[a + c];
        terms.F[a][c] = f_D_q[a + c];
      }
      terms.residual[a] = stages.momentum_residual(i, a, p[a], f[a]);
    }
    if (stages.loaded()) add_load_terms(stages, i, u, y, p_D_q, f_D_q, terms);
  }

  // Torque and drag turn with the link: û_a·∂R/∂q_c, and û_a·∂R/∂v_c.
  void add_load_terms(Stages& stages, int i, const typename Link::template First<L>& u,
                      const typename Link::template First<L>& y, const typename Link::template Symmetric<L>& p_D_q,
                      const typename Link::template Symmetric<L>& f_D_q, Terms& terms) {
    const auto torque = stages.torque(i);
    const L damping(stages.constants(i).damping);
    for (std::size_t c = 0; c < K; ++c) {
      Cartesian turning, drag, drag_D_v;
      Link::torque_load(torque, u[c], turning);
      Link::drag_load(damping, y[c], drag);
      Link::drag_load(damping, u[c], drag_D_v);
      for (std::size_t a = 0; a < K; ++a) {
        terms.F[a][c] = f_D_q[a + c] + dot(u[a], sum(turning, drag));
        terms.T_minus[a][c] = p_D_q[a + c] + dot(u[a], drag_D_v);
      }
    }
  }

  void eliminate(const Stages& stages, const Terms& terms, Carried& carried, Gain& gain) {
    const auto& columns = stages.columns();
    detail::Block<vectors, unknowns, Real> J, BJ;
    detail::Block<unknowns, vectors, Real> E;
    detail::Block<unknowns, unknowns, Real> S_block;
    fill_couplings(columns, terms, J, E);
    fill_diagonal(columns, terms, S_block);
    gain = Gain{};
    add_product(carried.P, J, BJ);
    add_product(E, carried.P, gain.K);
    add_product(E, BJ, S_block);
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t k = 0; k < s; ++k) gain.k[a * s + k] = terms.residual[a][k];
    }
    add_product(E, carried.g, gain.k);
    solve_negated(S_block, gain.K, gain.k);
    add_product(BJ, gain.K, carried.P);
    add_product(BJ, gain.k, carried.g);
  }

  static void fill_couplings(const detail::StageColumns<S, Real>& columns, const Terms& terms,
                             detail::Block<vectors, unknowns, Real>& J, detail::Block<unknowns, vectors, Real>& E) {
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t d = 0; d < Dim; ++d) {
        for (std::size_t k = 0; k < s; ++k) {
          for (std::size_t j = 0; j < s; ++j) {
            J[d * s + k][a * s + j] = columns.ha(k, j) * terms.y[a][d][k];
            E[a * s + k][d * s + j] = -columns.ha(k, j) * terms.y[a][d][j];
          }
          J[d * s + k][a * s + k] += terms.u[a][d][k];
          E[a * s + k][d * s + k] += terms.u[a][d][k];
        }
      }
    }
  }

  static void fill_diagonal(const detail::StageColumns<S, Real>& columns, const Terms& terms,
                            detail::Block<unknowns, unknowns, Real>& D) {
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t c = 0; c < K; ++c) {
        for (std::size_t k = 0; k < s; ++k) {
          Real* row = D[a * s + k] + c * s;
          for (std::size_t m = 0; m < s; ++m) row[m] = columns.ha(k, m) * (terms.T[a][c][k] - terms.T_minus[a][c][m]);
          for (std::size_t j = 0; j < s; ++j) {
            const Real bent = columns.ha(k, j) * terms.F[a][c][j];
            for (std::size_t m = 0; m < s; ++m) row[m] -= bent * columns.ha(j, m);
          }
        }
      }
    }
  }

  PENDULA_IN_REGISTERS Correction outward(Stages& stages) {
    alignas(pack_alignment) Real dw[vectors] = {};
    Cartesian lanes_dw;
    lanes_dw.fill(L(Real(0)));
    Real largest(0), scale(0);
    int at = -1;
    for (int i = 0; i < stages.links(); ++i) {
      alignas(pack_alignment) Real dV[K][Z] = {};
      const Real change = stage_changes(gains_[i], dw, dV);
      if (!(change <= largest)) {  // also where it is not a number
        largest = change;
        at = i;
      }
      scale = std::max(scale, apply(stages, i, dV, lanes_dw));
      for (std::size_t d = 0; d < Dim; ++d) {
        alignas(pack_alignment) Real stored[Z];
        lanes_dw[d].store(stored);
        std::copy_n(stored, s, dw + d * s);
      }
    }
    return {static_cast<double>(largest > 0 ? Real(largest / scale) : largest), at};
  }

  // δV = k + K δw; the largest of it, or NaN.
  static Real stage_changes(const Gain& gain, const Real* dw, Real (&dV)[K][Z]) {
    using std::abs;
    Real largest(0);
    for (std::size_t u = 0; u < unknowns; ++u) {
      Real change = gain.k[u];
      for (std::size_t k = 0; k < vectors; ++k) change += gain.K[u][k] * dw[k];
      dV[u / s][u % s] = change;
      const Real size = abs(change);
      if (!(size <= largest)) largest = size;
    }
    return largest;
  }

  // V += δV, δw += l (û_a δV_a + y_a δQ_a); the largest V.
  Real apply(Stages& stages, int i, const Real (&dV)[K][Z], Cartesian& dw) const {
    const auto trig = stages.trig(i);
    Coordinates v = stages.rates(i), p, f;
    Cartesian none, dW;
    none.fill(L(Real(0)));
    dW.fill(L(Real(0)));
    typename Link::template First<L> u, y;
    typename Link::template Symmetric<L> p_D_q, f_D_q;
    Link::newton_terms(trig, v, none, none, u, y, p, f, p_D_q, f_D_q);
    Real largest(0);
    for (std::size_t a = 0; a < K; ++a) {
      const L change = L::load(dV[a]), moved = stages.columns().integral(change);
      for (std::size_t k = 0; k < Dim; ++k) dW[k] = dW[k] + (u[a][k] * change + y[a][k] * moved);
      v[a] = v[a] + change;
      alignas(pack_alignment) Real stored[Z];
      abs(v[a]).store(stored);
      for (std::size_t k = 0; k < s; ++k) largest = std::max(largest, stored[k]);
    }
    stages.set_rates(i, v);
    dw = sum(dw, to_world(stages.chart(i), scaled(L(stages.constants(i).length), dW)));
    return largest;
  }

  detail::PerLink<Gain, N> gains_;
};

}  // namespace pendula
