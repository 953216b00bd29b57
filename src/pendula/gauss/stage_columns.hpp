#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <pendula/gauss/node_polynomials.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/stage_product.hpp>

namespace pendula::detail {

/// The coefficients of a step, one column a stage, padded to `Width` lanes. S may be Eigen::Dynamic: then columns are
/// padded like rows, and lanes beyond the stages must hold finite numbers. Another step size costs only a few
/// operations on packs.
template <int S, class Real, int Width = lanes_for<Real>(S)>
class StageColumns {
  using L = Pack<Width, RegisterFor<Width, Real>>;
  static constexpr auto columns = static_cast<std::size_t>(S == Eigen::Dynamic ? Width : S);
  static constexpr std::size_t Z = Width;

 public:
  explicit StageColumns(Family family = Family::gauss, int stages = S)
      : StageColumns(tableau_of<S, Real>(family, stages)) {}

  int stages() const { return static_cast<int>(stages_); }

  /// Prepares a step of size `h` after one of `previous` (0: there is none).
  void prepare(Real h, Real previous) {
    if (h != h_) {
      h_ = h;
      fold();
    }
    if (previous == 0) return;
    const Real ratio = h / previous;
    if (ratio != ratio_) predict_at(Real(1), ratio);
  }

  /// Prepares predictions for a step that is `ratio` times as long as the last one, and begins at `from`, in steps from
  /// the start of the last one.
  void predict_at(Real from, Real ratio) {
    from_ = from;
    ratio_ = from == 1 ? ratio : Real(0);
    const auto values = polynomials_.lagrange(fma(L(ratio), L::load(c_), L(from)));
    // b_i/b_j by b, not by h b: for a step of length zero that would be NaN.
    for (std::size_t j = 0; j < stages_; ++j) {
      values[j].store(extrapolation_[j]);
      (L::load(b_) * L(Real(ratio * inverse_b_[j])) * values[j]).store(increments_[j]);
    }
  }

  Real h() const { return h_; }
  Real b(std::size_t j) const { return b_[j]; }
  Real c(std::size_t i) const { return c_[i]; }
  Real m(std::size_t i, std::size_t j) const { return m_[j][i]; }
  Real hb(std::size_t j) const { return hb_[j]; }
  Real ha(std::size_t i, std::size_t j) const { return m_[j][i] * hb_[j]; }

  const Real* m() const { return &m_[0][0]; }  ///< column by column
  const Real* each_hb() const { return hb_; }

  L c() const { return L::load(c_); }
  L hb() const { return L::load(hb_); }          ///< h b
  L hc() const { return L::load(hc_); }          ///< h c
  L hc_low() const { return L::load(hc_low_); }  ///< what hc lost to rounding

  /// m_ij of all i.
  L column(std::size_t j) const { return L::load(m_[j]); }

  /// h a_ij of all i.
  L ha(std::size_t j) const { return L(hb_[j]) * L::load(m_[j]); }

  /// 1 in lane j, 0 elsewhere.
  static L unit(std::size_t j) { return L::load(units.values[j]); }

  /// Σ_j m_ij x_j for all i, with x already times h b_j, added to `start`.
  L integral(const Real* x, const L& start) const { return product(m_, x, start); }
  L integral(const L& x, const L& start = L(Real(0))) const {
    alignas(pack_alignment) Real stored[Z];
    x.store(stored);
    return product(m_, stored, start);
  }

  /// The polynomial through stage values, at the start of their step. x holds them times h b_j.
  Real at_start(const Real* x) const {
    Real sum(0);
    for (std::size_t j = 0; j < stages_; ++j) sum += h_ == 0 ? Real(0) : Real(start_[j] * x[j] / hb_[j]);
    return sum;
  }
  /// The error of the stage polynomial at the last stage of the next step, relative to that at the start of its own.
  Real predictor_gain() const {
    Real gain(1);
    for (std::size_t j = 0; j < stages_; ++j) gain *= (1 + c_[stages_ - 1] - c_[j]) / c_[j];
    return gain;
  }

  /// x holds stage values, each times h b_j. A polynomial goes through the values themselves. Returns its coefficients
  /// in Legendre polynomials on the step, times h.
  L legendre(const Real* x) const { return product(legendre_, x); }

  /// Bounds of |∫_0^x f| and of |f(x) − f(0)| over the step, both times h. Known are the stage values, times h b,
  /// alone: the last two coefficients of the polynomial through them tell what it misses of f.
  struct Excursion {
    Real integral, change;
  };
  Excursion excursion(const Real* x) const {
    constexpr Real missed_at_most(4);  // times the last coefficients; 1.3 times was seen
    alignas(pack_alignment) Real coefficients[Z];
    legendre(x).store(coefficients);
    using std::abs;
    Real changing(0), last(abs(coefficients[stages_ - 1]));
    for (std::size_t k = 1; k < stages_; ++k) changing += abs(coefficients[k]);
    if (stages_ > 1) last = std::max(last, abs(coefficients[stages_ - 2]));
    const Real missed = missed_at_most * last;
    return {abs(coefficients[0]) + changing + missed, 2 * (changing + missed)};
  }

  /// The polynomial through the last step's stage values, at this step's stages.
  L extrapolated(const Real* last) const { return product(extrapolation_, last); }

  /// The same, where `last` holds the values times h b of their step.
  L extrapolated_increments(const Real* last) const { return product(increments_, last); }

  using Weights = typename NodePolynomials<S, Real>::Values;

  /// Weights of stage values: of the polynomial through them at x, and of its integral from the start to x.
  Weights values(const Real& x) const { return polynomials_.lagrange(x); }
  Weights integrals(const Real& x) const { return polynomials_.integrals(x); }

  /// Weights of stage values times h b: of the integral of the polynomial from the start of their step to x.
  Weights up_to(const Real& x) const {
    Weights weights = polynomials_.integrals(x);
    for (std::size_t j = 0; j < stages_; ++j) weights[j] *= inverse_b_[j];
    return weights;
  }

  /// Weights of the same: of the polynomial at x in a step of size h.
  Weights rate_at(const Real& x, const Real& h) const {
    Weights weights = polynomials_.lagrange(x);
    for (std::size_t j = 0; j < stages_; ++j) weights[j] *= inverse_b_[j] / h;
    return weights;
  }

 private:
  explicit StageColumns(const Tableau<S, Real>& tableau)
      : family_(tableau.family), stages_(static_cast<std::size_t>(tableau.stages())), polynomials_(tableau) {
    start_ = polynomials_.lagrange(Real(0));
    for (std::size_t j = 0; j < stages_; ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      b_[j] = tableau.b[column];
      inverse_b_[j] = 1 / b_[j];
      c_[j] = tableau.c[column];
      c_low_[j] = tableau.c_low[column];
      for (std::size_t i = 0; i < stages_; ++i) {
        m_[j][i] = tableau.m(static_cast<Eigen::Index>(i), column);
        legendre_[j][i] = polynomials_.legendre(i, j) * inverse_b_[j];
      }
    }
    fold();
    predict_at(Real(1), Real(1));
  }

  [[gnu::always_inline]] static L product(const Real (&column)[columns][Z], const Real* x,
                                          const L& start = L(Real(0))) {
    return stage_product<L, columns, Z>(&column[0][0], x, start);
  }

  void fold() {
    for (std::size_t i = 0; i < stages_; ++i) {
      const Twofold<Real> exact = exact_product(h_, c_[i]);
      hc_[i] = exact.value;
      hc_low_[i] = exact.low + h_ * c_low_[i];
      hb_[i] = h_ * b_[i];
    }
    round_weights(family_, h_, hb_, stages());
  }

  struct Units {
    alignas(pack_alignment) Real values[columns][Z] = {};
    constexpr Units() {
      for (std::size_t j = 0; j < columns; ++j) values[j][j] = Real(1);
    }
  };
  static constexpr Units units{};

  Family family_;
  std::size_t stages_;
  NodePolynomials<S, Real> polynomials_;
  Real h_{0}, from_{1}, ratio_{1};
  alignas(pack_alignment) Real m_[columns][Z] = {};
  alignas(pack_alignment) Real legendre_[columns][Z] = {};
  alignas(pack_alignment) Real extrapolation_[columns][Z] = {};
  alignas(pack_alignment) Real increments_[columns][Z] = {};
  alignas(pack_alignment) Real b_[Z] = {};
  alignas(pack_alignment) Real c_[Z] = {};
  alignas(pack_alignment) Real hb_[Z] = {};
  alignas(pack_alignment) Real hc_[Z] = {};
  alignas(pack_alignment) Real hc_low_[Z] = {};
  Real c_low_[columns] = {}, inverse_b_[columns] = {};
  typename NodePolynomials<S, Real>::Values start_{};
};

}  // namespace pendula::detail
