#pragma once

namespace pendula {

/// The multipliers τ of a chain's rods, from the symmetric tridiagonal system that keeps every |ξ_i| constant:
///   square_i τ_i + beyond_i τ_{i+1} + beyond_{i−1} τ_{i−1} = right_i,
///   square_i = (1/m_i + 1/m_{i−1}) |ξ_i|²,  beyond_i = −ξ_i·ξ_{i+1}/m_i,  1/m_0 = 0.
/// It is positive definite, so that no pivoting is needed. Rows are eliminated from the tip to the pivot of the chain;
/// then τ_i = offset_i − coupling_i τ_{i−1} outward. Number is a number or a pack.
template <class Number>
struct MultiplierRow {
  Number offset{0.0};    ///< τ_i if τ_{i−1} were zero
  Number coupling{0.0};  ///< τ_i = offset − coupling τ_{i−1}

  /// The row of the rod before this one. beyond: its coupling to this rod; before: to the rod before it.
  MultiplierRow next(const Number& square, const Number& beyond, const Number& before, const Number& right) const {
    const Number inverse = Number(1.0) / (square - beyond * coupling);
    return {(right - beyond * offset) * inverse, before * inverse};
  }
};

}  // namespace pendula
