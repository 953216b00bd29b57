#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lagrangian_jacobians.hpp>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/numeric/lanes.hpp>
#include <vector>

namespace pendula {

/// One tangent through one step of any system in momentum form, by the linearised stage equations and a fixed point,
/// all stages in the lanes of SIMD registers:
///   δQ = δq + m W,  δP = δp + m U,  W = h b δv(δQ, δP),  U = h b δf(δQ, δP).
/// A step that fixed points solved is one for which they contract.
template <int Width>
class LagrangianDirection {
 public:
  using Stages = LagrangianStages<Width, MomentumForm>;
  using Jacobians = LagrangianJacobians<Width>;

  explicit LagrangianDirection(std::size_t coordinates)
      : count_(coordinates),
        rates_(3 * count_ * count_),
        increments_(2 * count_),
        places_(3 * count_),
        weights_(2 * count_),
        pushed_(2 * count_ * count_) {}

  /// At the stages of a step.
  void linearize(const Stages& stages) {
    for (std::size_t k = 0; k < count_; ++k) {
      weights_[k] = stages.weight(k);
      weights_[count_ + k] = stages.push_weight(k);
    }
    has_rates_ = false;
  }

  /// Replaces tangents at the start of the step, (2 coordinates x directions) row by row, by those at its end. There
  /// are no more of them than coordinates. Returns false, and leaves them as they were, if one does not converge to
  /// round-off.
  bool push(const Jacobians& jacobians, const typename Stages::Columns& columns, double* tangents, int directions) {
    find_rates(jacobians);
    const auto width = static_cast<std::size_t>(directions);
    for (std::size_t c = 0; c < width; ++c) {
      if (!push_one(jacobians, columns, tangents + c, pushed_.data() + c, width)) return false;
    }
    std::copy_n(pushed_.data(), 2 * count_ * width, tangents);
    return true;
  }

 private:
  using L = typename Stages::L;

  static constexpr int most_iterations = 50;
  // Relative sizes of corrections: below `negligible` the next one is less than rounding; below `rounding` they may
  // stop shrinking.
  static constexpr double negligible = 4e-16, rounding = 1e-14;

  double* v_D_q(std::size_t i, std::size_t j) { return rates_[i * count_ + j]; }
  double* v_D_p(std::size_t i, std::size_t j) { return rates_[(count_ + i) * count_ + j]; }

  // ∂(v, f)/∂(q, p): with M = ∂p/∂v, by elimination in place, which takes no pivots from a mass matrix.
  void find_rates(const Jacobians& jacobians) {
    if (has_rates_) return;
    has_rates_ = true;
    const auto mass = [&](std::size_t i, std::size_t j) { return rates_[(2 * count_ + i) * count_ + j]; };
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j < count_; ++j) {
        (-jacobians.p_D_q(i, j)).store(v_D_q(i, j));
        L(i == j ? 1.0 : 0.0).store(v_D_p(i, j));
        jacobians.p_D_v(i, j).store(mass(i, j));
      }
    }
    for (std::size_t k = 0; k < count_; ++k) {
      const L inverse = L(1.0) / L::load(mass(k, k));
      for (std::size_t j = 0; j < count_; ++j) {
        for (double* number : {mass(k, j), v_D_p(k, j), v_D_q(k, j)}) (inverse * L::load(number)).store(number);
      }
      for (std::size_t i = 0; i < count_; ++i) {
        if (i == k) continue;
        const L factor = -L::load(mass(i, k));
        const auto add = [&](const double* from, double* to) { fma(factor, L::load(from), L::load(to)).store(to); };
        for (std::size_t j = 0; j < count_; ++j) {
          add(mass(k, j), mass(i, j));
          add(v_D_p(k, j), v_D_p(i, j));
          add(v_D_q(k, j), v_D_q(i, j));
        }
      }
    }
  }

  // Propagates one column of tangents.
  PENDULA_IN_REGISTERS bool push_one(const Jacobians& jacobians, const typename Stages::Columns& columns,
                                     const double* tangent, double* pushed, std::size_t width) {
    std::fill_n(increments_[0], 2 * count_ * static_cast<std::size_t>(Width), 0.0);
    double before = std::numeric_limits<double>::infinity(), last = before;
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
      const double correction = iterate(jacobians, columns, tangent, width);
      if (!std::isfinite(correction)) return false;
      if (correction <= negligible || (correction < rounding && correction > before / 2)) {
        double sum = 0;
        for (std::size_t k = 0; k < 2 * count_; ++k) {
          sum += pushed[k * width] = tangent[k * width] + total(increments_[k]);
        }
        return std::isfinite(sum);  // a change that is no number may have gone by the largest
      }
      before = last;
      last = correction;
    }
    return false;
  }

  // Replaces the increments once; gives the largest change over the largest increment.
  double iterate(const Jacobians& jacobians, const typename Stages::Columns& columns, const double* tangent,
                 std::size_t width) {
    for (std::size_t k = 0; k < 2 * count_; ++k) {
      columns.integral(increments_[k], L(tangent[k * width])).store(places_[k]);
    }
    const L hb = columns.hb();
    L change(0.0), size(std::numeric_limits<double>::min());
    const auto replace = [&](std::size_t k, const L& rate) {
      const L now = hb * rate, weight(weights_[k]);
      change = max(change, weight * abs(now - L::load(increments_[k])));
      size = max(size, weight * abs(now));
      now.store(increments_[k]);
    };
    const auto Q = [&](std::size_t j) { return L::load(places_[j]); };
    const auto P = [&](std::size_t j) { return L::load(places_[count_ + j]); };
    for (std::size_t k = 0; k < count_; ++k) {
      L rate(0.0);
      for (std::size_t j = 0; j < count_; ++j) {
        rate = fma(L::load(v_D_q(k, j)), Q(j), fma(L::load(v_D_p(k, j)), P(j), rate));
      }
      rate.store(places_[2 * count_ + k]);
      replace(k, rate);
    }
    for (std::size_t k = 0; k < count_; ++k) {
      L rate(0.0);
      for (std::size_t j = 0; j < count_; ++j) {
        rate = fma(jacobians.f_D_q(k, j), Q(j), fma(jacobians.f_D_v(k, j), L::load(places_[2 * count_ + j]), rate));
      }
      replace(count_ + k, rate);
    }
    return largest(change) / largest(size);
  }

  // NaN if one of the numbers is NaN.
  static double largest(const L& lanes) {
    alignas(pack_alignment) typename Stages::Stored numbers;
    lanes.store(numbers);
    double largest = numbers[0];
    for (std::size_t j = 1; j < static_cast<std::size_t>(Width); ++j) {
      if (!(numbers[j] <= largest)) largest = numbers[j];
    }
    return largest;
  }
  static double total(const double* of) {
    double total = of[0];
    for (std::size_t j = 1; j < static_cast<std::size_t>(Width); ++j) total += of[j];
    return total;
  }

  std::size_t count_;
  typename Stages::Rows rates_;       // ∂v/∂q, ∂v/∂p, and workspace for ∂p/∂v
  typename Stages::Rows increments_;  // W, U
  typename Stages::Rows places_;      // δQ, δP, δV
  std::vector<double> weights_;       // of changes of increments
  std::vector<double> pushed_;
  bool has_rates_ = false;
};

}  // namespace pendula
