#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/kernels/gauss_tableaux.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {

/// Largest number of stages that has a tableau.
inline constexpr int max_stages = 8;

/// One number a stage; S may be Eigen::Dynamic, the storage is on the stack either way.
template <int S, class Real = double>
using StageVector = Eigen::Matrix<Real, S, 1, Eigen::ColMajor, S == Eigen::Dynamic ? max_stages : S, 1>;

/// One number for each pair of stages.
template <int S, class Real = double>
using StageMatrix = Eigen::Matrix<Real, S, S, Eigen::ColMajor, S == Eigen::Dynamic ? max_stages : S,
                                  S == Eigen::Dynamic ? max_stages : S>;

/// The methods that the stepper knows.
enum class Family {
  gauss,  ///< Gauss–Legendre, order 2s: symplectic and symmetric; s = 2 is paper eq. (48)–(51)
  radau,  ///< Radau IIA, order 2s − 1: damps at once what it does not resolve; 2 or 3 stages
};

constexpr int order_of(Family family, int stages) {
  return family == Family::gauss ? 2 * stages : 2 * stages - 1;
}

/// The coefficients of a method. To the last bit of a Real of up to
/// 106 bits, but for a_squared and extrapolation, where the bits of double are enough.
template <int S = Eigen::Dynamic, class Real = double>
struct Tableau {
  StageVector<S, Real> c, b;
  StageVector<S, Real> c_low;  ///< what c lost to rounding
  StageMatrix<S, Real> a;
  StageMatrix<S, Real> m;              ///< a_ij / b_j, m_ii = ½ and m_ij + m_ji = 1 exactly: what makes it symplectic
  StageMatrix<S, Real> a_squared;      ///< A², for the velocity form
  StageMatrix<S, Real> extrapolation;  ///< ℓ_j(1 + c_i): the last step's stage polynomial at this step's stages

  Family family = Family::gauss;

  int stages() const { return static_cast<int>(c.size()); }
};

/// The largest z up to which a step makes e^(−z) of what decays, but for `error` of z: the stability function is the
/// Padé approximant of e^(−z) by degrees k = s (Radau: s − 1) over s, off by k! s!/((k+s)! (k+s+1)!) z^(k+s+1).
inline double resolved_decay(Family family, int stages, double error) {
  const int above = family == Family::gauss ? stages : stages - 1;
  const double constant = std::tgamma(above + 1) * std::tgamma(stages + 1) /
                          (std::tgamma(above + stages + 1) * std::tgamma(above + stages + 2));
  return std::pow(error / constant, 1.0 / (above + stages));
}

namespace detail {

/// A generated tableau as what any of them is: matrices row by row.
struct GeneratedTableau {
  int stages;
  const double *c, *c_low, *b, *b_low, *a, *a_low, *m, *m_low, *a_squared, *extrapolation;
};

template <class Generated>
inline constexpr GeneratedTableau generated_tableau{Generated::stages,
                                                    Generated::c.data(),
                                                    Generated::c_low.data(),
                                                    Generated::b.data(),
                                                    Generated::b_low.data(),
                                                    Generated::a[0].data(),
                                                    Generated::a_low[0].data(),
                                                    Generated::m[0].data(),
                                                    Generated::m_low[0].data(),
                                                    Generated::a_squared[0].data(),
                                                    Generated::extrapolation[0].data()};

template <class Real, class Numbers>
void copy(const double* from, int stages, Numbers& to) {
  to.resize(stages, Numbers::ColsAtCompileTime == 1 ? 1 : stages);
  for (Eigen::Index i = 0; i < to.rows(); ++i) {
    for (Eigen::Index j = 0; j < to.cols(); ++j) to(i, j) = static_cast<Real>(from[i * to.cols() + j]);
  }
}

// m in the bits of Real. Of m_ij and m_ji the larger is rounded, and 1 minus it is exact (Sterbenz).
template <int S, class Real>
void round_symplectic(const StageMatrix<S, Real>& low, StageMatrix<S, Real>& m) {
  const StageMatrix<S, Real> whole = m + low;
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      const bool larger = whole(i, j) > whole(j, i);
      if (i != j) m(i, j) = larger ? whole(i, j) : Real(1) - whole(j, i);
    }
  }
}

template <int S, class Real>
Tableau<S, Real> make_tableau(Family family, const GeneratedTableau& from) {
  Tableau<S, Real> tableau;
  tableau.family = family;
  StageVector<S, Real> c, b_low;
  StageMatrix<S, Real> a_low, m_low;
  const auto read = [&](const double* numbers, auto& to) { copy<Real>(numbers, from.stages, to); };
  read(from.c, c);
  read(from.c_low, tableau.c_low);
  read(from.b, tableau.b);
  read(from.b_low, b_low);
  read(from.a, tableau.a);
  read(from.a_low, a_low);
  read(from.m, tableau.m);
  read(from.m_low, m_low);
  read(from.a_squared, tableau.a_squared);
  read(from.extrapolation, tableau.extrapolation);
  tableau.c = c + tableau.c_low;
  tableau.c_low += c - tableau.c;
  tableau.b += b_low;
  tableau.a += a_low;
  if (family == Family::gauss) {
    round_symplectic<S>(m_low, tableau.m);
  } else {
    tableau.m += m_low;
  }
  return tableau;
}

}  // namespace detail

/// Throws std::invalid_argument unless there is a tableau with this many stages.
inline void require_stages(int stages) {
  if (stages >= 1 && stages <= max_stages) return;
  throw std::invalid_argument("stages: expected 1 to " + std::to_string(max_stages) + ", got " +
                              std::to_string(stages));
}

namespace detail {

template <int... less_one>
constexpr auto generated_gauss(std::integer_sequence<int, less_one...>) {
  return std::array{generated_tableau<kernels::GaussTableau<less_one + 1>>...};
}

inline const GeneratedTableau& generated_of(Family family, int stages) {
  static constexpr auto gauss = generated_gauss(std::make_integer_sequence<int, max_stages>());
  static constexpr std::array radau = {generated_tableau<kernels::RadauTableau<2>>,
                                       generated_tableau<kernels::RadauTableau<3>>};
  if (family == Family::gauss) {
    require_stages(stages);
    return gauss[static_cast<std::size_t>(stages - 1)];
  }
  if (stages == 2 || stages == 3) return radau[static_cast<std::size_t>(stages - 2)];
  throw std::invalid_argument("stages: expected 2 or 3 for radau, got " + std::to_string(stages));
}

}  // namespace detail

/// The tableau of a method; where S is fixed, `stages` must equal it. Throws std::invalid_argument.
template <int S = Eigen::Dynamic, class Real = double>
Tableau<S, Real> tableau_of(Family family, int stages) {
  const detail::GeneratedTableau& generated = detail::generated_of(family, stages);
  if (S != Eigen::Dynamic && stages != S) {
    throw std::invalid_argument("stages: this solver is compiled for " + std::to_string(S));
  }
  return detail::make_tableau<S, Real>(family, generated);
}

namespace detail {

// Weights h b that do not sum to h exactly would make every step drift by an ulp of h. The inner ones are rounded to
// multiples of ulp(h), so that what they leave of h is exact, and its halves, the two equal outer ones, are too; of
// Radau, whose weights are all different, the last one takes it.
template <class Real, class Weights>
void round_weights(Family family, const Real& h, Weights& hb, int stages) {
  if (stages == 1) {
    hb[0] = h;
    return;
  }
  const bool symmetric = family == Family::gauss;
  Real rest = h;
  for (int j = symmetric ? 1 : 0; j + 1 < stages; ++j) {
    const Real sum = h + hb[j];
    hb[j] = sum - h;
    rest -= hb[j];
  }
  if (!symmetric) {
    hb[stages - 1] = rest;
  } else {
    hb[0] = hb[stages - 1] = rest / 2;
  }
}

}  // namespace detail

/// The tableau with the step size folded in, and the predictor for the ratio of this step to the last.
template <int S = Eigen::Dynamic, class Real = double>
class StepCoefficients {
 public:
  explicit StepCoefficients(const Tableau<S, Real>& tableau)
      : tableau_(tableau), extrapolation_(tableau.extrapolation) {
    hb_.resizeLike(tableau.b);
    ha_.resizeLike(tableau.a);
    h2a2_.resizeLike(tableau.a);
    fold(h_);  // resized storage is not written yet, and a first step of h_ would not write it
  }

  /// Prepares for a step of `h` after one of `previous` (0: there is none).
  void prepare(Real h, Real previous) {
    if (h != h_) fold(h);
    const Real ratio = previous == 0 ? Real(1) : Real(h / previous);
    if (ratio != ratio_) extrapolate(ratio);
  }

  int stages() const { return tableau_.stages(); }
  Real h() const { return h_; }
  Real hc(int i) const { return h_ * tableau_.c[i]; }
  Real b(int j) const { return tableau_.b[j]; }
  Real c(int i) const { return tableau_.c[i]; }
  Real c_low(int i) const { return tableau_.c_low[i]; }
  Real hb(int j) const { return hb_[j]; }  ///< h b_j, rounded so that they sum to h exactly
  Real m(int i, int j) const { return tableau_.m(i, j); }
  Real ha(int i, int j) const { return ha_(i, j); }  ///< m_ij · hb_j
  Real h2a2(int i, int j) const { return h2a2_(i, j); }
  Real extrapolation(int i, int j) const { return extrapolation_(i, j); }

  /// How much larger the error of the stage polynomial is at the last stage of the next step than at its own start.
  Real predictor_gain() const {
    Real gain(1);
    const Real end = 1 + tableau_.c[stages() - 1];
    for (int j = 0; j < stages(); ++j) gain *= (end - tableau_.c[j]) / tableau_.c[j];
    return gain;
  }

  /// ℓ_j(x) on the nodes c: the polynomial through stage values, x in steps from the start of theirs.
  Real lagrange(int j, Real x) const {
    Real value(1);
    for (int k = 0; k < stages(); ++k) {
      if (k != j) value *= (x - tableau_.c[k]) / (tableau_.c[j] - tableau_.c[k]);
    }
    return value;
  }

 private:
  void fold(Real h) {
    h_ = h;
    hb_ = h * tableau_.b;
    detail::round_weights(tableau_.family, h_, hb_, stages());
    ha_ = tableau_.m * hb_.asDiagonal();
    h2a2_ = (h * h) * tableau_.a_squared;
  }

  // ℓ_j(1 + ratio·c_i) on the nodes c.
  void extrapolate(Real ratio) {
    ratio_ = ratio;
    if (ratio == 1) {
      extrapolation_ = tableau_.extrapolation;
      return;
    }
    for (int i = 0; i < stages(); ++i) {
      for (int j = 0; j < stages(); ++j) extrapolation_(i, j) = lagrange(j, 1 + ratio * tableau_.c[i]);
    }
  }

  Tableau<S, Real> tableau_;
  StageVector<S, Real> hb_;
  StageMatrix<S, Real> ha_, h2a2_, extrapolation_;
  Real h_{0};
  Real ratio_{1};
};

}  // namespace pendula
