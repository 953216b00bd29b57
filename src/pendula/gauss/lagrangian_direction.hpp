#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lagrangian_jacobians.hpp>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/numeric/lanes.hpp>

namespace pendula {

/// One tangent through one step of any system in momentum form, by the linearised stage equations and a fixed point,
/// all stages in the lanes of SIMD registers:
///   δQ = δq + m W,  δP = δp + m U,  W = h b δv(δQ, δP),  U = h b δf(δQ, δP).
/// A step that fixed points solved is one for which they contract.
template <System S, int Width>
class LagrangianDirection {
 public:
  using Stages = LagrangianStages<S, Width>;

  /// The kernel's Jacobians at all stages, as they are.
  void linearize(const Stages& stages) {
    const L inverse = inverse_hb(stages.columns());
    for (std::size_t k = 0; k < count; ++k) {
      q_[at(k)] = stages.position(k);
      v_[at(k)] = inverse * L::load(stages.moved(k));
      weights_[k] = stages.weight(k);
      inverse_weights_[k] = stages.inverse_weight(k);
    }
    Vector p, f;
    S::momentum_form_with_jacobians(stages.parameters(), q_, v_, stages.inputs(), p, f, p_D_q_, p_D_v_, f_D_q_, f_D_v_);
    has_rates_ = false;
  }

  /// They and where they are, stage by stage.
  void read(LagrangianJacobians<S, Width>& jacobians) const {
    using Stage = typename LagrangianJacobians<S, Width>::Stage;
    for (std::size_t k = 0; k < count; ++k) {
      write(jacobians, q_[at(k)], [&](Stage& stage) -> double& { return stage.q[at(k)]; });
      write(jacobians, v_[at(k)], [&](Stage& stage) -> double& { return stage.v[at(k)]; });
      for (std::size_t j = 0; j < count; ++j) {
        const Eigen::Index row = at(k), column = at(j);
        write(jacobians, p_D_q_(row, column), [&](Stage& stage) -> double& { return stage.p_D_q(row, column); });
        write(jacobians, p_D_v_(row, column), [&](Stage& stage) -> double& { return stage.p_D_v(row, column); });
        write(jacobians, f_D_q_(row, column), [&](Stage& stage) -> double& { return stage.f_D_q(row, column); });
        write(jacobians, f_D_v_(row, column), [&](Stage& stage) -> double& { return stage.f_D_v(row, column); });
      }
    }
  }

  /// Replaces tangents at the start of the step, (2 coordinates x directions) row by row, no more of them than there
  /// are coordinates, by those at its end. False, and they are as they were, where one does not come to round-off.
  bool push(const typename Stages::Columns& columns, double* tangents, int directions) {
    find_rates();
    std::array<double, 2 * count * count> pushed;
    const auto width = static_cast<std::size_t>(directions);
    for (std::size_t c = 0; c < width; ++c) {
      if (!push_one(columns, tangents + c, pushed.data() + c, width)) return false;
    }
    std::copy_n(pushed.data(), 2 * count * width, tangents);
    return true;
  }

 private:
  static constexpr std::size_t count = Stages::count;
  using L = typename Stages::L;
  using Vector = typename Stages::Lanes;
  using Matrix = typename S::template Matrix<L>;
  using Stored = typename Stages::Stored;
  /// What stages add up from, one row a coordinate.
  struct Increments {
    alignas(pack_alignment) double of[count][static_cast<std::size_t>(Width)] = {};
  };

  static constexpr int most_iterations = 50;
  // Corrections, relative, of which the next is below rounding; and those that have stopped shrinking by rounding.
  static constexpr double negligible = 4e-16, rounding = 1e-14;

  static constexpr Eigen::Index at(std::size_t k) { return static_cast<Eigen::Index>(k); }

  // Lanes beyond the stages hold zero, and so do their rates.
  static L inverse_hb(const typename Stages::Columns& columns) {
    alignas(pack_alignment) Stored inverse = {};
    for (int j = 0; j < columns.stages(); ++j) inverse[j] = 1 / columns.hb(static_cast<std::size_t>(j));
    return L::load(inverse);
  }

  template <class Place>
  static void write(LagrangianJacobians<S, Width>& jacobians, const L& lanes, Place place) {
    alignas(pack_alignment) Stored numbers;
    lanes.store(numbers);
    for (int j = 0; j < jacobians.stages(); ++j) place(jacobians[j]) = numbers[j];
  }

  // ∂(v, f)/∂(q, p): with M = ∂p/∂v, by elimination in place, which takes no pivots from a mass matrix.
  void find_rates() {
    if (has_rates_) return;
    has_rates_ = true;
    v_D_p_.setConstant(L(0.0));
    v_D_q_ = p_D_q_;
    Matrix mass = p_D_v_;
    for (std::size_t k = 0; k < count; ++k) v_D_p_(at(k), at(k)) = L(1.0);
    for (std::size_t k = 0; k < count; ++k) {
      const L inverse = L(1.0) / mass(at(k), at(k));
      for (std::size_t j = 0; j < count; ++j) {
        mass(at(k), at(j)) = inverse * mass(at(k), at(j));
        v_D_p_(at(k), at(j)) = inverse * v_D_p_(at(k), at(j));
        v_D_q_(at(k), at(j)) = inverse * v_D_q_(at(k), at(j));
      }
      for (std::size_t i = 0; i < count; ++i) {
        if (i == k) continue;
        const L factor = -mass(at(i), at(k));
        for (std::size_t j = 0; j < count; ++j) {
          mass(at(i), at(j)) = fma(factor, mass(at(k), at(j)), mass(at(i), at(j)));
          v_D_p_(at(i), at(j)) = fma(factor, v_D_p_(at(k), at(j)), v_D_p_(at(i), at(j)));
          v_D_q_(at(i), at(j)) = fma(factor, v_D_q_(at(k), at(j)), v_D_q_(at(i), at(j)));
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j) {
        v_D_q_(at(i), at(j)) = -v_D_q_(at(i), at(j));
      }
    }
  }

  // One column of tangents, and of where they are pushed to.
  PENDULA_IN_REGISTERS bool push_one(const typename Stages::Columns& columns, const double* tangent, double* pushed,
                                     std::size_t width) const {
    Increments moved, forced;
    double before = std::numeric_limits<double>::infinity(), last = before;
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
      const double correction = iterate(columns, tangent, width, moved, forced);
      if (!std::isfinite(correction)) return false;
      if (correction <= negligible || (correction < rounding && correction > before / 2)) {
        double sum = 0;
        for (std::size_t k = 0; k < count; ++k) {
          sum += pushed[k * width] = tangent[k * width] + total(moved.of[k]);
          sum += pushed[(count + k) * width] = tangent[(count + k) * width] + total(forced.of[k]);
        }
        return std::isfinite(sum);  // a change that is no number may have gone by the largest
      }
      before = last;
      last = correction;
    }
    return false;
  }

  // Replaces the increments once; gives the largest change over the largest increment.
  double iterate(const typename Stages::Columns& columns, const double* tangent, std::size_t width, Increments& moved,
                 Increments& forced) const {
    Vector Q, P, V;
    for (std::size_t k = 0; k < count; ++k) {
      Q[at(k)] = columns.integral(moved.of[k], L(tangent[k * width]));
      P[at(k)] = columns.integral(forced.of[k], L(tangent[(count + k) * width]));
    }
    const L hb = columns.hb();
    L change(0.0), size(std::numeric_limits<double>::min());
    const auto replace = [&](double* of, const L& rate, double weight) {
      const L now = hb * rate;
      change = max(change, L(weight) * abs(now - L::load(of)));
      size = max(size, L(weight) * abs(now));
      now.store(of);
    };
    for (std::size_t k = 0; k < count; ++k) {
      L rate(0.0);
      for (std::size_t j = 0; j < count; ++j) {
        rate = fma(v_D_q_(at(k), at(j)), Q[at(j)], fma(v_D_p_(at(k), at(j)), P[at(j)], rate));
      }
      V[at(k)] = rate;
      replace(moved.of[k], rate, weights_[k]);
    }
    for (std::size_t k = 0; k < count; ++k) {
      L rate(0.0);
      for (std::size_t j = 0; j < count; ++j) {
        rate = fma(f_D_q_(at(k), at(j)), Q[at(j)], fma(f_D_v_(at(k), at(j)), V[at(j)], rate));
      }
      replace(forced.of[k], rate, inverse_weights_[k]);
    }
    return largest(change) / largest(size);
  }

  // NaN where any number is none.
  static double largest(const L& lanes) {
    alignas(pack_alignment) Stored numbers;
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

  Vector q_, v_;
  Matrix p_D_q_, p_D_v_, f_D_q_, f_D_v_;  // of the kernel
  Matrix v_D_q_, v_D_p_;                  // of rates, given momenta
  std::array<double, count> weights_{}, inverse_weights_{};
  bool has_rates_ = false;
};

}  // namespace pendula
