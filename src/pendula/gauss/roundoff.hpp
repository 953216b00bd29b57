#pragma once

#include <limits>
#include <utility>

namespace pendula {

/// Decides when an iteration has reached round-off: not at a fixed tolerance, which a long chain may never meet, but
/// when the correction is a few ulp, or stops shrinking while small, or is so small that the next one of a
/// quadratically convergent iteration is below round-off (Hairer, McLachlan, Razakarivony 2008; arXiv:1702.03354).
class RoundoffStop {
 public:
  enum class Convergence { linear, quadratic };

  explicit RoundoffStop(Convergence convergence) : convergence_(convergence) {}

  void restart() { last_ = std::numeric_limits<double>::infinity(); }

  /// Takes the size of a correction, relative to the unknowns, just applied; tells whether it was the last one needed.
  bool reached(double correction) {
    const double previous = std::exchange(last_, correction);
    if (correction <= few_ulp) return true;
    if (correction >= previous) return previous <= small;
    return convergence_ == Convergence::quadratic && next_newton_correction(previous, correction) <= negligible;
  }

  double last() const { return last_; }

 private:
  // Corrections of Newton obey δ_{k+1} ≈ C δ_k², so δ_{k+1}/δ_k ≈ (δ_k/δ_{k−1})²; infinity where there is only one yet.
  static double next_newton_correction(double previous, double correction) {
    if (previous == std::numeric_limits<double>::infinity()) return previous;
    const double rate = correction / previous;
    return correction * rate * rate;
  }

  static constexpr double few_ulp = 2 * std::numeric_limits<double>::epsilon();
  static constexpr double negligible = std::numeric_limits<double>::epsilon() / 16;
  static constexpr double small = 1e-7;  // no iteration that converges stops shrinking above this

  Convergence convergence_;
  double last_ = std::numeric_limits<double>::infinity();
};

}  // namespace pendula
