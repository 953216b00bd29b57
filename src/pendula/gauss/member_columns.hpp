#pragma once

#include <array>
#include <pendula/gauss/node_polynomials.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/lane_pack.hpp>

namespace pendula {

namespace detail {

/// Compiled once for registers of all widths: inlined copies would fuse multiplications and additions differently.
template <int S>
[[gnu::noinline]] NodePolynomials<S, double> node_polynomials(const Tableau<S>& tableau) {
  return NodePolynomials<S, double>(tableau);
}

}  // namespace detail

/// The coefficients of Gauss steps of several members, each of its own size.
///
/// Nodes and weights are symmetric: m_ij = ½ + k_ij with k_ji = −k_ij and k_i'j' = −k_ij, i' being the stage opposite
/// to i. Even and odd parts of stage values, x_j ± x_j', are multiplied by matrices of half the size, A_ij =
/// (k_ij + k_ij')/2 and −Aᵀ. That halves the products, and is symplectic to the last bit whatever A is rounded to.
template <int S, class L>
class MemberColumns {
 public:
  /// One number at all stages.
  template <class Number>
  using StagesOf = std::array<Number, static_cast<std::size_t>(S)>;
  using Stages = StagesOf<L>;
  using Mask = typename L::Mask;

  MemberColumns() : tableau_(tableau_of<S>(Family::gauss, S)), polynomials_(detail::node_polynomials<S>(tableau_)) {
    for (int i = 0; i < half; ++i) {
      for (int j = 0; j < half; ++j) {
        const double same = tableau_.m(i, j) - 0.5, opposite = tableau_.m(i, S - 1 - j) - 0.5;
        even_[i][j] = (same + opposite) / 2;
      }
      middle_[i] = tableau_.m(i, S / 2) - 0.5;
    }
    for (int k = 0; k < S; ++k) {
      for (int j = 0; j < S; ++j) {
        legendre_[k][j] = polynomials_.legendre(at(k), at(j));
      }
      b_[k] = tableau_.b[k];
      c_[k] = tableau_.c[k];
      inverse_b_[k] = 1 / b_[k];
      for (int j = 0; j < S; ++j) m_[k][j] = tableau_.m(k, j);
    }
    at_start_ = polynomials_.lagrange(0.0);
    prepare(L(0.0));
    predict_at(L(1.0), L(1.0), L(1.0));
  }

  /// For steps of `h`.
  void prepare(const L& h) {
    if (xsimd::all(h == h_)) return;
    h_ = h;
    L rest = h;
    for (int j = 0; j < S; ++j) {
      const Twofold<L> exact = exact_product(h, L(tableau_.c[j]));
      hc_[at(j)] = exact.value;
      hc_low_[at(j)] = fma(h, L(tableau_.c_low[j]), exact.low);
      hb_[at(j)] = h * L(tableau_.b[j]);
    }
    for (int j = 1; j + 1 < S; ++j) {  // weights sum to h exactly: detail::round_weights
      hb_[at(j)] = (h + hb_[at(j)]) - h;
      rest = rest - hb_[at(j)];
    }
    hb_[0] = hb_[at(S - 1)] = S == 1 ? h : 0.5 * rest;
  }

  /// Most steps that a prediction is made from. It pays with few stages, whose steps are short.
  static constexpr int most_depth = S <= 3 ? 8 : 1;

  /// Prepares predictions for a step that begins at `from`, in steps from the start of the last one, and is `ratio`
  /// times as long. Where the last `depth` steps had one size, each stage is continued from step to step. Its values
  /// are smooth so; from stage to stage they are not, by errors of order S + 1.
  PENDULA_IN_REGISTERS void predict_at(const L& from, const L& ratio, const L& depth) {
    if (!xsimd::all((from == from_) & (ratio == ratio_))) {
      from_ = from;
      ratio_ = ratio;
      for (int i = 0; i < S; ++i) within_[at(i)] = polynomials_.lagrange(fma(ratio, L(c_[i]), from));
    }
    if (most_depth == 1 || xsimd::all(depth == depth_)) return;
    depth_ = depth;
    deep_ = depth >= L(double(least_depth));
    L weight = -L(1.0);
    for (int d = 0; d < most_depth; ++d) {  // of a polynomial of degree depth − 1: ±binomial coefficients
      weight = weight * (depth - L(double(d))) * L(-1.0 / (d + 1));
      across_[at(d)] = floor(weight + L(0.5));
    }
  }

  const L& h() const { return h_; }
  const L& ratio() const { return ratio_; }
  const L& hb(int j) const { return hb_[at(j)]; }          ///< h b_j, their sum h exactly
  const L& hc(int j) const { return hc_[at(j)]; }          ///< h c_j
  const L& hc_low(int j) const { return hc_low_[at(j)]; }  ///< what h c_j lost to rounding

  /// start + Σ_j m_ij x_j for all i, x times h b. Number: L, or one with its derivative (Dual).
  template <class Number>
  [[gnu::always_inline]] void integrate(const StagesOf<Number>& x, const Number& start,
                                        StagesOf<Number>& integral) const {
    if constexpr (S < 4) {
      detail::unrolled<S>([&](auto i) PENDULA_WRITTEN_OUT {
        Number sum = start;
        detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { sum = fma(x[j], L(m_[i][j]), sum); });
        integral[i] = sum;
      });
    } else {
      integrate_symmetric(x, start, integral);
    }
  }

  /// The stages of the last steps, the newest first; either all of them hold the factor h, or none.
  template <class Number>
  using HistoryOf = std::array<const StagesOf<Number>*, static_cast<std::size_t>(most_depth)>;
  using History = HistoryOf<L>;
  template <class Number>
  [[gnu::always_inline]] void extrapolate(const HistoryOf<Number>& last, StagesOf<Number>& next, bool times_h) const {
    if (most_depth > 1 && xsimd::any(deep_)) {
      detail::unrolled<S>([&](auto i) PENDULA_WRITTEN_OUT {
        Number sum = (*last[0])[i] * across_[0];
        detail::unrolled<most_depth - 1>(
            [&](auto d) PENDULA_WRITTEN_OUT { sum = fma((*last[d + 1])[i], across_[d + 1], sum); });
        next[i] = sum;
      });
      if (xsimd::all(deep_)) return;
    }
    detail::unrolled<S>([&](auto i) PENDULA_WRITTEN_OUT {
      Number sum = (*last[0])[0] * within_[i][0];
      detail::unrolled<S - 1>([&](auto j)
                                  PENDULA_WRITTEN_OUT { sum = fma((*last[0])[j + 1], within_[i][j + 1], sum); });
      if (times_h) sum = ratio_ * sum;
      next[i] = most_depth > 1 ? select(deep_, next[i], sum) : sum;
    });
  }

  /// The mean over a step of the function with these stage values.
  template <class Number>
  Number mean(const StagesOf<Number>& x) const {
    Number sum = L(b_[0]) * x[0];
    detail::unrolled<S - 1>([&](auto j) PENDULA_WRITTEN_OUT { sum = fma(L(b_[j + 1]), x[j + 1], sum); });
    return sum;
  }

  double b(int j) const { return b_[j]; }
  double inverse_b(int j) const { return inverse_b_[j]; }

  /// The coefficient of the Legendre polynomial P_k on the step, for stage values x. If x holds the factor h, so does
  /// the coefficient.
  L legendre(int k, const Stages& x) const {
    L sum = legendre_[k][0] * x[0];
    for (int j = 1; j < S; ++j) sum = fma(L(legendre_[k][j]), x[at(j)], sum);
    return sum;
  }

  /// The polynomial through stage values at the start of their step.
  L at_start(const Stages& x) const {
    L sum = at_start_[0] * x[0];
    for (int j = 1; j < S; ++j) sum = fma(L(at_start_[at(j)]), x[at(j)], sum);
    return sum;
  }

  /// Weights of stage values, which hold the factor h, where a share of the step is done.
  struct Shares {
    double share = -1;
    std::array<double, static_cast<std::size_t>(S)> values,
        ahead;  ///< of the value there; of the integral from there to the end
  };
  const Shares& shares(double share) {
    Shares* weights = &shares_.front();
    for (Shares& kept : shares_) {
      if (kept.share == share) return kept;
      weights = &kept;
      if (kept.share < 0) break;
    }
    weights->share = share;
    weights->values = polynomials_.lagrange(share);
    weights->ahead = polynomials_.integrals(share);
    for (int j = 0; j < S; ++j) weights->ahead[at(j)] = b_[j] - weights->ahead[at(j)];
    return *weights;
  }

  /// Σ_j x_j.
  template <class Number>
  static Number total(const StagesOf<Number>& x) {
    if constexpr (S == 1) return x[0];
    Number sum = x[0] + x[at(S - 1)];
    for (int j = 1; j < half; ++j) sum = sum + (x[at(j)] + x[at(S - 1 - j)]);
    return S % 2 == 1 ? sum + x[S / 2] : sum;
  }

 private:
  static constexpr int least_depth = S + 1;

  static constexpr int half = S / 2;
  static constexpr auto count = static_cast<std::size_t>(S), halves = static_cast<std::size_t>(half);
  static constexpr std::size_t at(int j) { return static_cast<std::size_t>(j); }

  template <class Number>
  [[gnu::always_inline]] void integrate_symmetric(const StagesOf<Number>& x, const Number& start,
                                                  StagesOf<Number>& integral) const {
    constexpr bool has_middle = S % 2 == 1;
    std::array<Number, halves> even, odd;
    detail::unrolled<half>([&](auto j) PENDULA_WRITTEN_OUT {
      even[j] = x[j] + x[S - 1 - j];
      odd[j] = x[j] - x[S - 1 - j];
    });
    Number sum = even[0];
    detail::unrolled<half - 1>([&](auto j) PENDULA_WRITTEN_OUT { sum = sum + even[j + 1]; });
    if constexpr (has_middle) sum = sum + x[half];
    const Number base = fma(L(0.5), sum, start);
    if constexpr (has_middle) {
      Number of_middle = base;
      detail::unrolled<half>([&](auto j) PENDULA_WRITTEN_OUT { of_middle = fma(L(-middle_[j]), odd[j], of_middle); });
      integral[half] = of_middle;
    }
    detail::unrolled<half>([&](auto i) PENDULA_WRITTEN_OUT {
      Number rising = L(even_[i][0]) * even[0], common = fma(L(-even_[0][i]), odd[0], base);
      detail::unrolled<half - 1>([&](auto j) PENDULA_WRITTEN_OUT {
        rising = fma(L(even_[i][j + 1]), even[j + 1], rising);
        common = fma(L(-even_[j + 1][i]), odd[j + 1], common);
      });
      if constexpr (has_middle) rising = fma(L(middle_[i]), x[half], rising);
      integral[i] = common + rising;
      integral[S - 1 - i] = common - rising;
    });
  }

  Tableau<S> tableau_;
  detail::NodePolynomials<S, double> polynomials_;
  double even_[halves + 1][halves + 1] = {}, middle_[halves + 1] = {};
  double legendre_[count][count] = {}, m_[count][count] = {}, b_[count] = {}, c_[count] = {}, inverse_b_[count] = {};
  std::array<double, count> at_start_;
  L h_{-1.0}, from_{-1.0}, ratio_{-1.0}, depth_{-1.0};
  Stages hb_, hc_, hc_low_;
  std::array<Stages, static_cast<std::size_t>(S)> within_;
  std::array<L, static_cast<std::size_t>(most_depth)> across_;
  Mask deep_;
  std::array<Shares, 10> shares_;  // those that are asked for again and again; the last one is what was asked last
};

}  // namespace pendula
