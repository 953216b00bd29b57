#pragma once

#include <array>
#include <cstddef>
#include <pendula/gauss/tableau.hpp>

namespace pendula::detail {

/// Polynomials through one number at each node of a method; x is time in steps, from the start of their step on.
template <int S, class Real>
class NodePolynomials {
 public:
  static constexpr auto most = static_cast<std::size_t>(S == Eigen::Dynamic ? max_stages : S);
  using Values = std::array<Real, most>;  ///< one a node

  explicit NodePolynomials(const Tableau<S, Real>& tableau) : count_(static_cast<std::size_t>(tableau.stages())) {
    for (std::size_t j = 0; j < count_; ++j) nodes_[j] = tableau.c[static_cast<Eigen::Index>(j)];
    for (std::size_t j = 0; j < count_; ++j) {
      Real product(1);
      for (std::size_t k = 0; k < count_; ++k) {
        if (k != j) product *= nodes_[j] - nodes_[k];
      }
      weights_[j] = 1 / product;
      const auto values = legendre_polynomials<most>(nodes_[j]);
      const Real b = tableau.b[static_cast<Eigen::Index>(j)];
      for (std::size_t k = 0; k < count_; ++k) legendre_[k][j] = Real(2 * k + 1) * b * values[k];
    }
  }

  /// ℓ_j(x) for all nodes j; Number is Real or a pack.
  template <class Number>
  std::array<Number, most> lagrange(const Number& x) const {
    std::array<Number, most> values;
    Number below(Real(1)), above(Real(1));
    for (std::size_t j = 0; j < count_; ++j) {
      values[j] = Number(weights_[j]) * below;
      below = below * (x - Number(nodes_[j]));
    }
    for (std::size_t j = count_; j-- > 0;) {
      values[j] = values[j] * above;
      above = above * (x - Number(nodes_[j]));
    }
    return values;
  }

  /// ∫_0^x ℓ_j for all nodes j.
  Values integrals(const Real& x) const {
    const auto P = legendre_polynomials<most + 1>(x);
    Values values{};
    for (std::size_t k = 0; k < count_; ++k) {
      const Real before = k == 0 ? Real(-1) : P[k - 1];
      const Real integral = (P[k + 1] - before) / Real(2 * (2 * k + 1));
      for (std::size_t j = 0; j < count_; ++j) values[j] += legendre_[k][j] * integral;
    }
    return values;
  }

  /// The coefficient of the Legendre polynomial P_k on the step in ℓ_j.
  const Real& legendre(std::size_t k, std::size_t j) const { return legendre_[k][j]; }

 private:
  // P_0, P_1, … on [0, 1].
  template <std::size_t Count>
  static std::array<Real, Count + 1> legendre_polynomials(const Real& x) {
    const Real y = 2 * x - 1;
    std::array<Real, Count + 1> values{Real(1), y};
    for (std::size_t k = 2; k <= Count; ++k) {
      values[k] = (Real(2 * k - 1) * y * values[k - 1] - Real(k - 1) * values[k - 2]) / Real(k);
    }
    return values;
  }

  std::size_t count_;
  Values nodes_{}, weights_{};
  std::array<Values, most> legendre_{};  // [polynomial][node]
};

}  // namespace pendula::detail
