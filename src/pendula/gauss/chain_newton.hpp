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

/// A small matrix, row by row, its rows padded to packs. Rows are written whole where they are read whole soon after: a
/// processor hands on what it has just stored, but not a row that was stored in pieces.
template <std::size_t Rows, std::size_t Columns, class Real>
struct Block {
  static constexpr std::size_t stride = padded_row<Real>(Columns);
  // Small blocks wait for one another, and registers of four hand on quicker than registers of eight.
  static constexpr int widest = stride <= 8 ? 4 : 8;
  using Row = Pack<static_cast<int>(stride), RegisterFor<static_cast<int>(stride), Real, widest>>;

  alignas(pack_alignment) Real values[Rows][stride];

  Real* operator[](std::size_t row) { return values[row]; }
  const Real* operator[](std::size_t row) const { return values[row]; }
  Row row(std::size_t i) const { return Row::load(values[i]); }
  void set_row(std::size_t i, const Row& row) { row.store(values[i]); }

  /// x in column k, zero elsewhere.
  static Row unit(std::size_t k, const Real& x) { return Row(x) * Row::load(units.values[k]); }

 private:
  struct Units {
    alignas(pack_alignment) Real values[Columns][stride] = {};
    constexpr Units() {
      for (std::size_t k = 0; k < Columns; ++k) values[k][k] = Real(1);
    }
  };
  static inline const Units units;
};

/// The row a times B, added to `start`; two sums side by side, so that one does not wait for the other.
template <std::size_t Inner, std::size_t Columns, class Real>
auto row_of_product(const Real* a, const Block<Inner, Columns, Real>& b,
                    const typename Block<Inner, Columns, Real>::Row& start) {
  using Row = typename Block<Inner, Columns, Real>::Row;
  Row even = fma(Row(a[0]), b.row(0), start);
  if constexpr (Inner == 1) return even;
  Row odd = Row(a[1]) * b.row(1);
  for (std::size_t k = 2; k + 1 < Inner; k += 2) {
    even = fma(Row(a[k]), b.row(k), even);
    odd = fma(Row(a[k + 1]), b.row(k + 1), odd);
  }
  if (Inner % 2 == 1) even = fma(Row(a[Inner - 1]), b.row(Inner - 1), even);
  return even + odd;
}

/// C = A B.
template <std::size_t M, std::size_t Inner, std::size_t Columns, class Real>
void set_product(const Block<M, Inner, Real>& a, const Block<Inner, Columns, Real>& b, Block<M, Columns, Real>& c) {
  using Row = typename Block<M, Columns, Real>::Row;
  for (std::size_t i = 0; i < M; ++i) c.set_row(i, row_of_product(a[i], b, Row(Real(0))));
}

/// C = a B.
template <std::size_t M, std::size_t Columns, class Real>
void set_scaled(const Real& a, const Block<M, Columns, Real>& b, Block<M, Columns, Real>& c) {
  using Row = typename Block<M, Columns, Real>::Row;
  for (std::size_t i = 0; i < M; ++i) c.set_row(i, Row(a) * b.row(i));
}

/// C += A B.
template <std::size_t M, std::size_t Inner, std::size_t Columns, class Real>
void add_product(const Block<M, Inner, Real>& a, const Block<Inner, Columns, Real>& b, Block<M, Columns, Real>& c) {
  for (std::size_t i = 0; i < M; ++i) c.set_row(i, row_of_product(a[i], b, c.row(i)));
}

/// Replaces the square of S from (k, k) on, of one row or of two, by the negative of its inverse: one division either
/// way.
template <std::size_t M, class Real>
void invert_negated(Block<M, M, Real>& S, std::size_t k) {
  if (k + 1 == M) {
    S[k][k] = -1 / S[k][k];
    return;
  }
  const Real a = S[k][k], b = S[k][k + 1], c = S[k + 1][k], d = S[k + 1][k + 1];
  const Real inverse = 1 / (b * c - a * d);
  S[k][k] = d * inverse;
  S[k][k + 1] = -b * inverse;
  S[k + 1][k] = -c * inverse;
  S[k + 1][k + 1] = a * inverse;
}

/// Y_i += a Y_k + b Y_{k+1}.
template <std::size_t M, std::size_t Columns, class Real>
void add_rows(Block<M, Columns, Real>& Y, std::size_t i, std::size_t k, const Real& a, const Real& b) {
  using Row = typename Block<M, Columns, Real>::Row;
  Y.set_row(i, fma(Row(a), Y.row(k), fma(Row(b), Y.row(k + 1), Y.row(i))));
}

/// Y_k from the rows after it, by row k of S, whose diagonal squares are negative inverses; of one row or of two.
template <std::size_t M, std::size_t Columns, class Real>
void substitute_back(const Block<M, M, Real>& S, Block<M, Columns, Real>& Y, std::size_t k) {
  using Row = typename Block<M, Columns, Real>::Row;
  Row first = Y.row(k);
  if (k + 1 == M) return Y.set_row(k, Row(S[k][k]) * first);
  Row second = Y.row(k + 1);
  for (std::size_t j = k + 2; j < M; ++j) {
    first = fma(Row(S[k][j]), Y.row(j), first);
    second = fma(Row(S[k + 1][j]), Y.row(j), second);
  }
  Y.set_row(k, fma(Row(S[k][k]), first, Row(S[k][k + 1]) * second));
  Y.set_row(k + 1, fma(Row(S[k + 1][k]), first, Row(S[k + 1][k + 1]) * second));
}

/// Replaces every Y by −S⁻¹ Y, two rows at a time. No pivoting: S is a mass matrix but for terms of the order of the
/// step, and a step that spoils it does not converge and is halved.
template <std::size_t M, class Real, std::size_t... Columns>
void solve_negated(Block<M, M, Real>& S, Block<M, Columns, Real>&... Y) {
  for (std::size_t k = 0; k < M; k += 2) {
    invert_negated(S, k);
    for (std::size_t i = k + 2; i < M; ++i) {
      const Real first = S[i][k] * S[k][k] + S[i][k + 1] * S[k + 1][k];
      const Real second = S[i][k] * S[k][k + 1] + S[i][k + 1] * S[k + 1][k + 1];
      for (std::size_t j = k + 2; j < M; ++j) S[i][j] += first * S[k][j] + second * S[k + 1][j];
      (add_rows(Y, i, k, first, second), ...);
    }
  }
  for (std::size_t done = M % 2 == 0 ? 2 : 1; done <= M; done += 2) (substitute_back(S, Y, M - done), ...);
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

  explicit ChainNewton(int links) : gains_(links) {
    for (std::size_t k = 0; k < s; ++k) unit_[k].values[k] = Real(1);
  }

  /// Improves the stage velocities once.
  Correction correct(Stages& stages) {
    stages.place();
    stages.run_out();
    set_coefficients(stages.columns());
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
    L lanes() const { return L::load(values); }
  };

  struct Directions {
    PerStage u[K][Dim], y[K][Dim];  // l û_a, l y_a along the axes of the world
  };

  struct Terms : Directions {
    PerStage T[K][K], T_minus[K][K], F[K][K];
    PerStage residual[K];
  };

  struct Carried {  // δG = P δw + g
    detail::Block<vectors, vectors, Real> P;
    detail::Block<vectors, 1, Real> g{};
  };

  struct Gain {  // δV = K δw + k
    detail::Block<unknowns, vectors, Real> K{};
    detail::Block<unknowns, 1, Real> k{};
  };

  void set_coefficients(const detail::StageColumns<S, Real>& columns) {
    if (columns.h() == h_) return;
    h_ = columns.h();
    for (std::size_t u = 0; u < unknowns; ++u) {
      for (std::size_t j = 0; j < s; ++j) ha_[u][u / s * s + j] = columns.ha(u % s, j);
    }
    for (std::size_t k = 0; k < s; ++k) {
      for (std::size_t j = 0; j < s; ++j) ha_lanes_[k].values[j] = columns.ha(k, j);
    }
  }

  // Carries the mass of the bob to come on the diagonal of P, where nothing has to wait for it.
  PENDULA_IN_REGISTERS void inward(Stages& stages) {
    Carried carried;
    Cartesian G;
    G.fill(L(Real(0)));
    Terms terms;
    const int last = stages.links() - 1;
    for (std::size_t k = 0; k < vectors; ++k) carried.P.set_row(k, carried.P.unit(k, stages.constants(last).mass));
    for (int i = last; i >= 0; --i) {
      G = sum(G, scaled(L(stages.constants(i).mass), stages.bob_velocity(i)));
      find_terms(stages, i, G, terms);
      eliminate(stages, i, terms, carried);
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
    set_directions(chart, l, u, y, terms);
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t c = 0; c < K; ++c) {
        terms.T[a][c] = p_D_q[a + c];  // θθ, θφ, φφ
        terms.T_minus[a][c] = p_D_q[a + c];
        terms.F[a][c] = f_D_q[a + c];
      }
      terms.residual[a] = stages.momentum_residual(i, a, p[a], f[a]);
    }
    if (stages.loaded()) add_load_terms(stages, i, u, y, p_D_q, f_D_q, terms);
  }

  static void set_directions(Chart chart, const L& l, const typename Link::template First<L>& u,
                             const typename Link::template First<L>& y, Directions& directions) {
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t k = 0; k < Dim; ++k) {
        const auto axis = static_cast<std::size_t>(world_axis<Space>(chart, static_cast<int>(k)));
        directions.u[a][axis] = l * u[a][k];
        directions.y[a][axis] = l * y[a][k];
      }
    }
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

  // Nothing moves before the first link, K stays zero there; below the last one there is its own bob, P = m I.
  void eliminate(const Stages& stages, int i, const Terms& terms, Carried& carried) {
    const bool first = i == 0, last = i + 1 == stages.links();
    Gain& gain = gains_[i];
    using Jacobian = detail::Block<vectors, unknowns, Real>;
    Jacobian J, BJ;
    detail::Block<unknowns, vectors, Real> E;
    detail::Block<unknowns, unknowns, Real> D{};  // beyond its columns, too: denormal numbers there would be slow
    for (std::size_t d = 0; d < Dim; ++d) {
      for (std::size_t k = 0; k < s; ++k) J.set_row(d * s + k, velocity_row(terms, d, k));
    }
    fill_momentum_coupling(terms, E);
    fill_diagonal(stages.columns(), terms, D);
    last ? set_scaled(carried.P[0][0], J, BJ) : set_product(carried.P, J, BJ);
    add_product(E, BJ, D);  // now it is S
    for (std::size_t u = 0; u < unknowns; ++u) gain.k[u][0] = terms.residual[u / s][u % s];
    add_product(E, carried.g, gain.k);
    if (first) return solve_negated(D, gain.k);
    set_product(E, carried.P, gain.K);
    solve_negated(D, gain.K, gain.k);
    const Real& mass_before = stages.constants(i - 1).mass;
    for (std::size_t k = 0; k < vectors; ++k) {
      carried.P.set_row(k, row_of_product(BJ[k], gain.K, carried.P.row(k) + carried.P.unit(k, mass_before)));
    }
    add_product(BJ, gain.k, carried.g);
  }

  // Row (d, k) of J: l û_a δ_km + h a_km l y_a(k) over (a, m).
  auto velocity_row(const Terms& terms, std::size_t d, std::size_t k) const {
    using Jacobian = detail::Block<vectors, unknowns, Real>;
    auto row = Jacobian::unit(k, terms.u[0][d][k]) + typename Jacobian::Row(terms.y[0][d][k]) * ha_.row(k);
    for (std::size_t a = 1; a < K; ++a) {
      row = row + Jacobian::unit(a * s + k, terms.u[a][d][k]);
      row = fma(typename Jacobian::Row(terms.y[a][d][k]), ha_.row(a * s + k), row);
    }
    return row;
  }

  // E: l û_a δ_kj − h a_kj l y_a(j).
  void fill_momentum_coupling(const Terms& terms, detail::Block<unknowns, vectors, Real>& E) const {
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t k = 0; k < s; ++k) {
        for (std::size_t d = 0; d < Dim; ++d) {
          const L u = terms.u[a][d].lanes(), y = terms.y[a][d].lanes();
          set_stages(E[a * s + k] + d * s, unit_[k].lanes() * u - ha_lanes_[k].lanes() * y);
        }
      }
    }
  }

  void fill_diagonal(const detail::StageColumns<S, Real>& columns, const Terms& terms,
                     detail::Block<unknowns, unknowns, Real>& D) const {
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t c = 0; c < K; ++c) {
        for (std::size_t k = 0; k < s; ++k) {
          L row = ha_lanes_[k].lanes() * (L(terms.T[a][c][k]) - terms.T_minus[a][c].lanes());
          for (std::size_t j = 0; j < s; ++j) {
            row = row - L(columns.ha(k, j) * terms.F[a][c][j]) * ha_lanes_[j].lanes();
          }
          set_stages(D[a * s + k] + c * s, row);
        }
      }
    }
  }

  // The stages of a pack in a row, whole where the pack holds nothing else.
  static void set_stages(Real* row, const L& lanes) {
    if constexpr (Z == s) {
      lanes.store(row);
    } else {
      PerStage stored;
      stored = lanes;
      std::copy_n(stored.values, s, row);
    }
  }

  // Number by number, not in lanes: what a link waits for is short then, and lanes do not have to be taken apart.
  PENDULA_IN_REGISTERS Correction outward(Stages& stages) {
    Real dw[vectors] = {};
    Real largest(0);
    L scale(Real(0));
    int at = -1;
    for (int i = 0; i < stages.links(); ++i) {
      alignas(pack_alignment) Real dV[K][Z] = {};
      const Real change = stage_changes(gains_[i], dw, dV);
      if (!(change <= largest)) {  // also where it is not a number
        largest = change;
        at = i;
      }
      add_velocity(stages.columns(), directions(stages, i), dV, dw);
      Coordinates v = stages.rates(i);
      for (std::size_t a = 0; a < K; ++a) {
        v[a] = v[a] + L::load(dV[a]);
        scale = max(scale, abs(v[a]));
      }
      stages.set_rates(i, v);
    }
    return {static_cast<double>(largest > 0 ? Real(largest / largest_stage(scale)) : largest), at};
  }

  static Real largest_stage(const L& lanes) {
    PerStage stored;
    stored = lanes;
    return *std::max_element(stored.values, stored.values + s);
  }

  // δV = k + K δw; the largest of it, or NaN.
  static Real stage_changes(const Gain& gain, const Real* dw, Real (&dV)[K][Z]) {
    using std::abs;
    Real largest(0);
    for (std::size_t u = 0; u < unknowns; ++u) {
      Real even = gain.k[u][0], odd(0);
      for (std::size_t k = 0; k + 1 < vectors; k += 2) {
        even += gain.K[u][k] * dw[k];
        odd += gain.K[u][k + 1] * dw[k + 1];
      }
      if (vectors % 2 == 1) even += gain.K[u][vectors - 1] * dw[vectors - 1];
      const Real change = even + odd;
      dV[u / s][u % s] = change;
      const Real size = abs(change);
      if (!(size <= largest)) largest = size;
    }
    return largest;
  }

  Directions directions(const Stages& stages, int i) const {
    Directions directions;
    Cartesian none;
    none.fill(L(Real(0)));
    typename Link::template First<L> u, y;
    typename Link::template Symmetric<L> p_D_q, f_D_q;
    Coordinates p, f;
    Link::newton_terms(stages.trig(i), stages.rates(i), none, none, u, y, p, f, p_D_q, f_D_q);
    set_directions(stages.chart(i), L(stages.constants(i).length), u, y, directions);
    return directions;
  }

  // δw += l (û_a δV_a + y_a δQ_a), δQ = h A δV.
  static void add_velocity(const detail::StageColumns<S, Real>& columns, const Directions& directions,
                           const Real (&dV)[K][Z], Real* dw) {
    for (std::size_t a = 0; a < K; ++a) {
      for (std::size_t k = 0; k < s; ++k) {
        Real dQ(0);
        for (std::size_t j = 0; j < s; ++j) dQ += columns.ha(k, j) * dV[a][j];
        for (std::size_t d = 0; d < Dim; ++d) {
          dw[d * s + k] += directions.u[a][d][k] * dV[a][k] + directions.y[a][d][k] * dQ;
        }
      }
    }
  }

  detail::PerLink<Gain, N> gains_;
  detail::Block<unknowns, unknowns, Real> ha_{};  // (a, k): h a_km in the columns (a, m)
  PerStage ha_lanes_[s]{}, unit_[s]{};            // of k: h a_kj, δ_kj
  Real h_{0};                                     // that all of them are for
};

}  // namespace pendula
