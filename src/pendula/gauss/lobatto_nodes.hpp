#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <pendula/gauss/node_polynomials.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/linear_system.hpp>
#include <pendula/numeric/stage_product.hpp>

namespace pendula {

/// Where constraints hold in a step of a Gauss method with s stages: at the Lobatto nodes d_0 = 0, d_1, …, d_s = 1,
/// which determine a polynomial of degree s (L. Jay, SIAM J. Numer. Anal. 45, 2007: SPARK (s, s)-Gauss–Lobatto).
///
/// Increments h b V of the stages move coordinates at node k by Σ_j r_kj h b_j V_j, r_kj = (1/b_j) ∫_0^{d_k} ℓ_j.
/// Constraint impulses J_k = h w_k (∂g/∂q)ᵀ λ_k at the nodes add Σ_k (1 − r_kj) J_k to the momenta at stage j. The
/// method is symplectic because r here and 1 − r there add up to 1, as m_ij and m_ji of the stages do. Node 0 pushes
/// all stages, node s none.
template <int Width>
class LobattoNodes {
  static constexpr auto width = static_cast<std::size_t>(Width);
  using Columns = double[width][width];

 public:
  using L = Pack<Width, RegisterFor<Width>>;

  /// For Gauss methods with up to Width stages.
  explicit LobattoNodes(int stages) : LobattoNodes(tableau_of<Eigen::Dynamic>(Family::gauss, stages)) {}

  std::size_t stages() const { return stages_; }
  double d(std::size_t k) const { return d_[k]; }
  double w(std::size_t k) const { return w_[k]; }
  /// Size of the increments that remove an error of coordinates, relative to that error.
  double gain() const { return gain_; }

  /// start + what increments add up to at node k + 1, in lane k.
  L reached(const double* increments, const L& start) const { return product(reach_, increments, start); }

  /// What impulses at the nodes 0 … s − 1, one a lane, add to momenta at the stages.
  L pushed(const double* impulses) const { return product(push_, impulses); }

  /// What an impulse at node m adds, and where an increment of stage j moves nodes 1 … s.
  L push(std::size_t m) const { return L::load(push_[m]); }
  L reach(std::size_t j) const { return L::load(reach_[j]); }
  double reach(std::size_t j, std::size_t node) const { return reach_[j][node - 1]; }

  /// The increments of stages that add the same.
  L as_increments(const double* impulses) const { return product(increments_, impulses); }

  /// How far an impulse at node m moves coordinates at node k + 1, over h and by the mobility.
  double response(std::size_t k, std::size_t m) const { return response_[k][m]; }

  /// Prepares `predicted` for a step that begins at `from`, in steps from the start of the last one, and is `ratio`
  /// times as long.
  void predict_at(double from, double ratio) {
    if (from == from_ && ratio == ratio_) return;
    from_ = from;
    ratio_ = ratio;
    for (std::size_t j = 0; j < stages_; ++j) {
      for (std::size_t k = 0; k < stages_; ++k) {
        double value = 1;
        for (std::size_t i = 0; i < stages_; ++i) {
          if (i != j) value *= (from + ratio * d_[k] - d_[i]) / (d_[j] - d_[i]);
        }
        predict_[j][k] = value * ratio * w_[k] / w_[j];
      }
    }
  }
  /// Continues the impulses of the last step.
  L predicted(const double* last) const { return product(predict_, last); }

 private:
  explicit LobattoNodes(const Tableau<>& tableau) : stages_(static_cast<std::size_t>(tableau.stages())) {
    find_nodes();
    const detail::NodePolynomials<Eigen::Dynamic, double> polynomials(tableau);
    const auto count = static_cast<Eigen::Index>(stages_);
    LinearSystem chord(count), stages(count);
    Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(count, count), pushes(count, count);
    chord.matrix.setZero();
    stages.matrix = tableau.m;
    for (std::size_t j = 0; j < stages_; ++j) {
      const auto stage = static_cast<Eigen::Index>(j);
      for (std::size_t k = 0; k < stages_; ++k) {
        reach_[j][k] = k + 1 == stages_ ? 1.0 : polynomials.integrals(d_[k + 1])[j] / tableau.b[stage];
        push_[k][j] = k == 0 ? 1.0 : 1 - reach_[j][k - 1];
        pushes(stage, static_cast<Eigen::Index>(k)) = push_[k][j];
      }
      for (std::size_t k = 0; k < stages_; ++k) {
        for (std::size_t m = 0; m < stages_; ++m) {
          response_[k][m] += reach_[j][k] * tableau.b[stage] * push_[m][j];
          chord.matrix(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(m)) = response_[k][m];
        }
      }
    }
    chord.solve(unit.data(), count);
    stages.solve(pushes.data(), count);
    for (std::size_t m = 0; m < stages_; ++m) {
      for (std::size_t k = 0; k < stages_; ++k) {
        increments_[m][k] = pushes(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(m));
      }
    }
    find_gain(tableau, unit);
  }

  void find_gain(const Tableau<>& tableau, const Eigen::MatrixXd& chord) {
    for (std::size_t j = 0; j < stages_; ++j) {
      double sum = 0;
      for (std::size_t k = 0; k < stages_; ++k) {
        double moved = 0;
        for (std::size_t m = 0; m < stages_; ++m)
          moved += push_[m][j] * chord(static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(k));
        sum += std::abs(moved);
      }
      gain_ = std::max(gain_, tableau.b[static_cast<Eigen::Index>(j)] * sum);
    }
  }

  // Between the ends where the Legendre polynomial P_s has its extrema.
  void find_nodes() {
    const auto s = static_cast<double>(stages_);
    for (std::size_t k = 0; k <= stages_; ++k) {
      double y = -std::cos(std::numbers::pi * static_cast<double>(k) / s), value = 1;
      for (int correction = 0; correction < newton_corrections; ++correction) {
        double before = 1;
        value = y;
        for (double m = 1; m < s; ++m) {
          const double next = ((2 * m + 1) * y * value - m * before) / (m + 1);
          before = value;
          value = next;
        }
        if (k == 0 || k == stages_) break;
        const double slope = s * (before - y * value) / (1 - y * y);
        y -= slope * (1 - y * y) / (2 * y * slope - s * (s + 1) * value);
      }
      d_[k] = k == 0 ? 0 : k == stages_ ? 1 : (1 + y) / 2;
      w_[k] = 1 / (s * (s + 1) * value * value);
    }
  }

  static L product(const Columns& columns, const double* x, const L& start = L(0.0)) {
    return detail::stage_product<L, width, width>(&columns[0][0], x, start);
  }

  static constexpr int newton_corrections = 8;

  std::size_t stages_;
  double from_ = 0, ratio_ = 0, gain_ = 0;
  std::array<double, width + 1> d_{}, w_{};
  alignas(pack_alignment) Columns reach_{};
  alignas(pack_alignment) Columns push_{};
  Columns response_{};
  alignas(pack_alignment) Columns increments_{};
  alignas(pack_alignment) Columns predict_{};
};

}  // namespace pendula
