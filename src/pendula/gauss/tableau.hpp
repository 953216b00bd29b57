#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <pendula/kernels/gauss_tableaux.hpp>
#include <stdexcept>
#include <string>

namespace pendula {

/// Largest number of stages that has a tableau.
inline constexpr int max_stages = 8;

/// One number a stage; S may be Eigen::Dynamic, the storage is on the stack either way.
template <int S>
using StageVector = Eigen::Matrix<double, S, 1, Eigen::ColMajor, S == Eigen::Dynamic ? max_stages : S, 1>;

/// One number for each pair of stages.
template <int S>
using StageMatrix = Eigen::Matrix<double, S, S, Eigen::ColMajor, S == Eigen::Dynamic ? max_stages : S,
                                  S == Eigen::Dynamic ? max_stages : S>;

/// The Gauss–Legendre method of s stages and order 2s; s = 2 is paper eq. (48)–(51).
template <int S = Eigen::Dynamic>
struct Tableau {
  StageVector<S> c, b;
  StageMatrix<S> a;
  StageMatrix<S> m;              ///< a_ij / b_j with m_ii = ½ and m_ij + m_ji = 1 exactly: what makes it symplectic
  StageMatrix<S> a_squared;      ///< A², for the velocity form
  StageMatrix<S> extrapolation;  ///< ℓ_j(1 + c_i): the last step's stage polynomial at this step's stages

  int stages() const { return static_cast<int>(c.size()); }
};

namespace detail {

template <std::size_t From, int S>
void copy(const std::array<double, From>& from, StageVector<S>& to) {
  to = Eigen::Map<const Eigen::Matrix<double, static_cast<int>(From), 1>>(from.data());
}

template <std::size_t From, int S>
void copy(const std::array<std::array<double, From>, From>& from, StageMatrix<S>& to) {
  constexpr auto size = static_cast<int>(From);
  to = Eigen::Map<const Eigen::Matrix<double, size, size, size == 1 ? Eigen::ColMajor : Eigen::RowMajor>>(
      from[0].data());
}

template <int From, int S>
Tableau<S> make_tableau() {
  using Generated = kernels::GaussTableau<From>;
  Tableau<S> tableau;
  copy<static_cast<std::size_t>(From), S>(Generated::c, tableau.c);
  copy<static_cast<std::size_t>(From), S>(Generated::b, tableau.b);
  copy<static_cast<std::size_t>(From), S>(Generated::a, tableau.a);
  copy<static_cast<std::size_t>(From), S>(Generated::m, tableau.m);
  copy<static_cast<std::size_t>(From), S>(Generated::a_squared, tableau.a_squared);
  copy<static_cast<std::size_t>(From), S>(Generated::extrapolation, tableau.extrapolation);
  return tableau;
}

}  // namespace detail

/// Throws std::invalid_argument unless there is a tableau with this many stages.
inline void require_stages(int stages) {
  if (stages >= 1 && stages <= max_stages) return;
  throw std::invalid_argument("stages: expected 1 to " + std::to_string(max_stages) + ", got " +
                              std::to_string(stages));
}

/// The tableau of `stages` stages; where S is fixed, `stages` must equal it. Throws std::invalid_argument.
template <int S = Eigen::Dynamic>
Tableau<S> gauss_tableau(int stages) {
  require_stages(stages);
  if constexpr (S != Eigen::Dynamic) {
    if (stages != S) throw std::invalid_argument("stages: this solver is compiled for " + std::to_string(S));
    return detail::make_tableau<S, S>();
  } else {
    static constexpr std::array<Tableau<S> (*)(), max_stages> make = {
        &detail::make_tableau<1, S>, &detail::make_tableau<2, S>, &detail::make_tableau<3, S>,
        &detail::make_tableau<4, S>, &detail::make_tableau<5, S>, &detail::make_tableau<6, S>,
        &detail::make_tableau<7, S>, &detail::make_tableau<8, S>};
    return make[static_cast<std::size_t>(stages - 1)]();
  }
}

/// The tableau with the step size folded in, and the predictor for the ratio of this step to the last.
template <int S = Eigen::Dynamic>
class StepCoefficients {
 public:
  explicit StepCoefficients(const Tableau<S>& tableau) : tableau_(tableau), extrapolation_(tableau.extrapolation) {
    hb_.resizeLike(tableau.b);
    ha_.resizeLike(tableau.a);
    h2a2_.resizeLike(tableau.a);
  }

  /// Prepares for a step of `h` after one of `previous` (0: there is none).
  void prepare(double h, double previous) {
    if (h != h_) fold(h);
    const double ratio = previous == 0 ? 1 : h / previous;
    if (ratio != ratio_) extrapolate(ratio);
  }

  int stages() const { return tableau_.stages(); }
  double h() const { return h_; }
  double hc(int i) const { return h_ * tableau_.c[i]; }
  double hb(int j) const { return hb_[j]; }  ///< h b_j, rounded so that they sum to h exactly
  double m(int i, int j) const { return tableau_.m(i, j); }
  double ha(int i, int j) const { return ha_(i, j); }  ///< m_ij · hb_j
  double h2a2(int i, int j) const { return h2a2_(i, j); }
  double extrapolation(int i, int j) const { return extrapolation_(i, j); }

 private:
  void fold(double h) {
    h_ = h;
    hb_ = h * tableau_.b;
    make_sum_exact();
    ha_ = tableau_.m * hb_.asDiagonal();
    h2a2_ = (h * h) * tableau_.a_squared;
  }

  // Weights that do not sum to h exactly would make every step drift by an ulp of h. The inner ones are rounded to
  // multiples of ulp(h), so that what they leave of h is exact, and its halves, the two equal outer ones, are too.
  void make_sum_exact() {
    const Eigen::Index s = hb_.size();
    if (s == 1) {
      hb_[0] = h_;
      return;
    }
    double rest = h_;
    for (Eigen::Index j = 1; j + 1 < s; ++j) {
      const double sum = h_ + hb_[j];
      hb_[j] = sum - h_;
      rest -= hb_[j];
    }
    hb_[0] = hb_[s - 1] = rest / 2;
  }

  // ℓ_j(1 + ratio·c_i) on the nodes c.
  void extrapolate(double ratio) {
    ratio_ = ratio;
    if (ratio == 1) {
      extrapolation_ = tableau_.extrapolation;
      return;
    }
    for (int i = 0; i < stages(); ++i) {
      for (int j = 0; j < stages(); ++j) extrapolation_(i, j) = lagrange(j, 1 + ratio * tableau_.c[i]);
    }
  }

  double lagrange(int j, double x) const {
    double value = 1;
    for (int k = 0; k < stages(); ++k) {
      if (k != j) value *= (x - tableau_.c[k]) / (tableau_.c[j] - tableau_.c[k]);
    }
    return value;
  }

  Tableau<S> tableau_;
  StageVector<S> hb_;
  StageMatrix<S> ha_, h2a2_, extrapolation_;
  double h_ = 0;
  double ratio_ = 1;
};

}  // namespace pendula
