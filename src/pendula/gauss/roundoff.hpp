#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace pendula {

/// How the corrections of an iteration shrink.
enum class Convergence {
  linear,    ///< δ_{k+1} ≈ ρ δ_k: fixed point
  quadratic  ///< δ_{k+1} ≈ C δ_k²: Newton
};

/// Decides when an iteration has reached round-off, from the sizes of its corrections relative to the unknowns.
///
/// Not at a fixed tolerance, which a long chain may never meet (mathematics: "a fixed 1e-13 spins"), and not at the
/// first correction of a few ulp either: what is left out has the same sign step after step, and energy drifts by it.
/// An iteration stops where the *next* correction would be far below round-off, or where it no longer follows its own
/// rate of convergence, because only rounding is left (Hairer, McLachlan, Razakarivony 2008; arXiv:1702.03354).
class RoundoffStop {
 public:
  /// A new step begins. What Newton's constant C was is remembered from step to step.
  void restart() {
    count_ = 0;
    stalls_ = 0;
    ++steps_;
  }

  /// Takes the size of a correction just applied; tells whether it was the last one needed.
  bool reached(double correction, Convergence convergence) {
    if (convergence != convergence_) restart();  // other iterations shrink at other rates
    convergence_ = convergence;
    const double previous = std::exchange(last_, correction);
    if (++count_ == 1) {
      first_ = best_ = correction;
      return convergence == Convergence::quadratic && (correction == 0 || is_enough(correction));
    }
    if (correction == 0) return true;
    const bool done =
        convergence == Convergence::linear ? linear_done(previous, correction) : quadratic_done(previous, correction);
    best_ = std::min(best_, correction);
    return done;
  }

  double last() const { return last_; }

 private:
  bool linear_done(double previous, double correction) {
    const double rate = correction / previous;
    if (rate < 1 && correction * rate <= negligible) return true;
    return has_stalled(previous, correction, 2);
  }

  bool quadratic_done(double previous, double correction) {
    const double measured = correction / (previous * previous);
    if (correction > noise) constant_ = constant_ == 0 ? measured : std::max(measured, constant_ / 2);
    if (correction <= few_ulp || is_enough(correction)) return true;
    return has_stalled(previous, correction, 1);
  }

  // C from an earlier step may be out of date: now and then one more correction measures it again.
  bool is_enough(double correction) const {
    if (constant_ == 0 || (count_ == 1 && steps_ % check_interval == 0)) return false;
    return safety * constant_ * correction * correction <= negligible;
  }

  // Corrections that shrink by less than half the way that they went on average so far, and are small, are rounding.
  bool has_stalled(double previous, double correction, int enough) {
    if (correction > small || correction < previous / 2) return false;
    const double average = std::pow(best_ / first_, 1.0 / std::max(1, count_ - 2));
    if (correction >= previous * (1 + average) / 2) ++stalls_;
    return stalls_ >= enough;
  }

  static constexpr double few_ulp = 2 * std::numeric_limits<double>::epsilon();
  static constexpr double negligible = 1e-21;
  static constexpr double small = 1e-7;   // no iteration that converges stops shrinking above this
  static constexpr double noise = 1e-12;  // corrections below may be rounding alone and say nothing of C
  static constexpr double safety = 10;
  static constexpr int check_interval = 32;

  Convergence convergence_ = Convergence::quadratic;
  double first_ = 0, best_ = 0, last_ = 0;
  double constant_ = 0;
  int count_ = 0, stalls_ = 0, steps_ = 0;
};

}  // namespace pendula
