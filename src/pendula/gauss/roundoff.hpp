#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace pendula {

/// Where iterations on so many links usually stop shrinking, relative: 1e-12 in double, more where links are many. The
/// velocity of a link is the difference of momenta of all masses below it, a second one along the chain: rounding grows
/// like the square of its length. (Measured in space: 8e-10, 9e-8 and 1e-5 for 10³, 10⁴ and 10⁵ links.)
inline double usual_rounding(int links, double epsilon) {
  return std::max(4500.0, 45.0 * links * links) * epsilon;
}

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
  /// `epsilon` is that of the numbers that are iterated on.
  explicit RoundoffStop(int links, double epsilon = double_epsilon)
      : epsilon_(epsilon),
        rounded_(usual_rounding(links, epsilon)),
        small_(std::max(1e-7 * std::sqrt(coarser()), rounded_)) {}

  /// A new step begins. What Newton's constant C was is remembered from step to step.
  void restart() {
    count_ = kept_ = 0;
    last_ = {};
    ++steps_;
  }

  /// Takes the size of a correction just applied; tells whether it was the last one needed.
  bool reached(double correction, Convergence convergence) {
    if (convergence != convergence_) restart();  // other iterations shrink at other rates
    convergence_ = convergence;
    last_ = {correction, last_[0], last_[1], last_[2]};
    ++count_;
    return convergence == Convergence::linear ? linear_done() : quadratic_done();
  }

  /// What is remembered from step to step.
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(convergence_, constant_, steps_);
  }

 private:
  // A fixed point on velocities and forces is two interleaved sequences: velocities follow from the forces of the
  // iteration before, and those from the velocities before that. (From rest the first correction is exactly zero.) So
  // corrections are looked at in pairs, and their rate over two iterations. One that has not shrunk against the one
  // before the last, of its own sequence, has come to rounding, and the other sequence too if it is no larger.
  bool linear_done() {
    const double pair = std::max(last_[0], last_[1]), pair_before = std::max(last_[2], last_[3]);
    if (count_ < 3) return false;
    if (pair == 0) return true;
    const double rate = pair / pair_before;
    // From stages that were no prediction at all the first corrections shrink at no rate that would go on.
    if (rate < 1 && pair * rate <= lost_in_rounding() && pair <= small_) return true;
    if (count_ == 3) first_ = best_ = pair_before;
    const bool stalled = has_stalled(last_[0] / last_[2], 2.0 / std::max(1, count_ - 3));
    best_ = std::min(best_, pair);
    return stalled && last_[1] <= 2 * last_[0];
  }

  bool quadratic_done() {
    const double correction = last_[0];
    if (count_ == 1) {
      first_ = best_ = correction;
      return correction == 0 || is_enough(correction);
    }
    if (correction > noise() && last_[1] < 1) {
      const double measured = correction / (last_[1] * last_[1]);
      constant_ = constant_ == 0 ? measured : std::max(measured, constant_ / 2);
    }
    if (correction <= 2 * epsilon_ || is_enough(correction)) return true;
    const bool stalled = has_stalled(correction / last_[1], 1.0 / std::max(1, count_ - 2));
    best_ = std::min(best_, correction);
    return stalled;
  }

  // C from an earlier step may be out of date: now and then one more correction measures it again.
  bool is_enough(double correction) const {
    if (constant_ == 0 || (count_ == 1 && steps_ % check_interval == 0)) return false;
    return safety * constant_ * correction * correction <= negligible();
  }

  // Corrections that shrink by less than half the way that they went on average so far, and are small, are rounding; of
  // those that are as small as a last bit, half the way on a scale of powers will do. Where they are larger than is
  // usual, it may be a mode that a step does not resolve, and that hardly moves, which converges slowly, or not at all,
  // after those that move: rounding is what keeps its size.
  bool has_stalled(double rate, double exponent) {
    if (last_[0] > small_ || (rate < 0.5 && last_[0] > epsilon_)) return false;
    if (convergence_ == Convergence::linear && last_[0] > rounded_ && !keeps_its_size(rate)) return false;
    const double average = std::pow(best_ / first_, exponent);
    return rate >= std::max(0.5, (1 + average) / 2) || (last_[0] <= epsilon_ && rate >= std::sqrt(average));
  }

  bool keeps_its_size(double rate) {
    const bool kept = rate >= 0.9 && last_[0] <= 4 * best_;
    kept_ = kept ? kept_ + 1 : 0;
    return kept_ >= certainly;
  }

  static constexpr double double_epsilon = std::numeric_limits<double>::epsilon();

  double coarser() const { return epsilon_ / double_epsilon; }  // than double
  double negligible() const { return 1e-20 * coarser(); }
  // What the next correction of a fixed point may be, a thousandth of a last bit.
  double lost_in_rounding() const { return 1e-19 * coarser(); }
  // Corrections below may be rounding alone and say nothing of C.
  double noise() const { return 1e-12 * coarser(); }

  static constexpr double safety = 10;
  static constexpr int check_interval = 32, certainly = 8;

  double epsilon_;
  double rounded_;  // where iterations usually stop shrinking
  double small_;    // no iteration that converges stops shrinking above this
  Convergence convergence_ = Convergence::quadratic;
  std::array<double, 4> last_{};  // the newest first
  double first_ = 0, best_ = 0;
  double constant_ = 0;
  int count_ = 0, steps_ = 0;
  int kept_ = 0;  // corrections in a row
};

}  // namespace pendula
