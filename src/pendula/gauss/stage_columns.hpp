#pragma once

#include <array>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/lanes.hpp>

namespace pendula::detail {

/// The coefficients of a step, one column a stage, padded to `Width` lanes. S may be Eigen::Dynamic: then columns are
/// padded like rows, and what lanes beyond the stages hold must be finite.
template <int S, class Real, int Width = lanes_for<Real>(S)>
class StageColumns {
  using L = Pack<Width, RegisterFor<Width, Real>>;
  static constexpr std::size_t columns = S == Eigen::Dynamic ? Width : S, Z = Width;

 public:
  explicit StageColumns(Family family = Family::gauss, int stages = S)
      : coefficients_(tableau_of<S, Real>(family, stages)) {
    for (int i = 0; i < stages; ++i) {
      for (int j = 0; j < stages; ++j) m_[j][i] = coefficients_.m(i, j);
    }
    fold();
  }

  int stages() const { return coefficients_.stages(); }

  /// For a step of `h` after one of `previous` (0: there is none).
  void prepare(Real h, Real previous) {
    const Real ratio = previous == 0 ? Real(1) : Real(h / previous);
    coefficients_.prepare(h, previous);
    if (h != h_) {
      h_ = h;
      fold();
    } else if (ratio == ratio_) {
      return;
    }
    ratio_ = ratio;
    extrapolate();
  }

  Real h() const { return h_; }
  Real c(std::size_t i) const { return coefficients_.c(static_cast<int>(i)); }
  Real m(std::size_t i, std::size_t j) const { return coefficients_.m(static_cast<int>(i), static_cast<int>(j)); }
  Real hb(std::size_t j) const { return hb_[j]; }
  Real ha(std::size_t i, std::size_t j) const { return coefficients_.ha(static_cast<int>(i), static_cast<int>(j)); }

  L hb() const { return L::load(hb_); }          ///< h b
  L hc() const { return L::load(hc_); }          ///< h c
  L hc_low() const { return L::load(hc_low_); }  ///< what hc lost to rounding

  /// Σ_j m_ij x_j for all i, with x already times h b_j, added to `start`.
  L integral(const Real* x, const L& start) const { return product(m_, x, start); }
  L integral(const L& x, const L& start = L(Real(0))) const {
    alignas(pack_alignment) Real stored[Z];
    x.store(stored);
    return product(m_, stored, start);
  }

  /// The polynomial through stage values that hold the factor h b, at the start of their step.
  Real at_start(const Real* x) const {
    Real sum = start_[0] * x[0];
    for (std::size_t j = 1; j < columns; ++j) sum += start_[j] * x[j];
    return sum;
  }
  Real predictor_gain() const { return coefficients_.predictor_gain(); }

  /// The polynomial through the last step's stage values, at this step's stages.
  L extrapolated(const Real* last) const { return product(extrapolation_, last); }

  /// The same of values that hold the factor h b of their step.
  L extrapolated_increments(const Real* last) const { return product(increments_, last); }

  /// That polynomial in the middle of this step.
  Real at_half(const Real* last) const {
    Real sum = half_[0] * last[0];
    for (std::size_t j = 1; j < columns; ++j) sum += half_[j] * last[j];
    return sum;
  }

 private:
  static L product(const Real (&column)[columns][Z], const Real* x, const L& start = L(Real(0))) {
    L even = fma(L(x[0]), L::load(column[0]), start);
    if constexpr (columns == 1) return even;
    L odd = L(x[columns > 1]) * L::load(column[columns > 1]);
    for (std::size_t j = 2; j < columns; j += 2) {
      even = fma(L(x[j]), L::load(column[j]), even);
      if (j + 1 < columns) odd = fma(L(x[j + 1]), L::load(column[j + 1]), odd);
    }
    return even + odd;
  }

  void fold() {
    for (int i = 0; i < stages(); ++i) {
      const Twofold<Real> exact = exact_product(h_, coefficients_.c(i));
      hc_[i] = exact.value;
      hc_low_[i] = exact.low + h_ * coefficients_.c_low(i);
      hb_[i] = coefficients_.hb(i);
      start_[i] = h_ == 0 ? Real(0) : Real(coefficients_.lagrange(i, Real(0)) / hb_[i]);
    }
  }

  // b_i/b_j, not of h b: of a step of no length that would be no number.
  void extrapolate() {
    for (int j = 0; j < stages(); ++j) {
      half_[j] = coefficients_.lagrange(j, 1 + ratio_ / 2);
      for (int i = 0; i < stages(); ++i) {
        extrapolation_[j][i] = coefficients_.extrapolation(i, j);
        increments_[j][i] = ratio_ * (coefficients_.b(i) / coefficients_.b(j)) * extrapolation_[j][i];
      }
    }
  }

  StepCoefficients<S, Real> coefficients_;
  Real h_{0}, ratio_{0};
  alignas(pack_alignment) Real m_[columns][Z] = {};
  alignas(pack_alignment) Real extrapolation_[columns][Z] = {};
  alignas(pack_alignment) Real increments_[columns][Z] = {};
  alignas(pack_alignment) Real hb_[Z] = {};
  alignas(pack_alignment) Real hc_[Z] = {};
  alignas(pack_alignment) Real hc_low_[Z] = {};
  Real half_[columns] = {}, start_[columns] = {};
};

}  // namespace pendula::detail
