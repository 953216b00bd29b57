#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// How small the corrections of a fixed point become, relative to what a step moves.
struct CorrectionLimits {
  double enough = 1e-18;  ///< of the first correction that is left out: far below a last bit
  double last_bit = std::numeric_limits<double>::epsilon();
  double usual = 1e-12;  ///< where they usually stop shrinking
  double small = 1e-9;   ///< no iteration that converges stops shrinking above this
  int certainly = 1;     ///< how often in a row those that are larger than usual have to keep their size
};

/// Decides when the fixed point of one motion, or of each of several, has reached round-off, from the sizes of its
/// corrections: squared, and relative to the size of the step by `scale`, squared too.
///
/// Not at a fixed tolerance, which a long chain may never meet (mathematics: "a fixed 1e-13 spins"), and not at the
/// first correction of a few ulp either: what is left out has the same sign step after step, and energy drifts by it.
/// An iteration stops where the *next* correction would be far below round-off, or where it no longer follows its own
/// rate of convergence, because only rounding is left (Hairer, McLachlan, Razakarivony 2008; arXiv:1702.03354).
///
/// Where the unknowns are rates and forces, set Sequences = 2: rates follow from the forces of the iteration before,
/// and forces from its rates, so that two sequences alternate. The size of a correction is then the larger of two
/// consecutive ones, and the rate of convergence compares sizes two iterations apart.
template <class Num, int Sequences = 1>
class FixedPointStop {
 public:
  using Mask = MaskOf<Num>;

  explicit FixedPointStop(const CorrectionLimits& limits)
      : enough_(squared(limits.enough)),
        last_bit_(squared(limits.last_bit)),
        usual_(squared(limits.usual)),
        small_(squared(limits.small)),
        certainly_(limits.certainly) {}

  /// Another motion takes the place of one of several.
  void forget(int member) { set(rate_, member, 1); }

  /// A new step begins.
  void restart(const Num& scale) {
    count_ = 0;
    scale_ = scale;
    kept_ = Num(0.0);
    last_.fill(Num(0.0));
  }

  /// Takes the corrections just made. Verdict: which iterations have arrived, and which never will.
  struct Verdict {
    Mask done, lost;
  };
  Verdict judge(const Num& correction, const Mask& active) {
    ++count_;
    for (std::size_t k = known - 1; k > 0; --k) last_[k] = last_[k - 1];
    last_[0] = correction;
    if (count_ == 1) {
      first_ = correction;
      scale_ = max(scale_, correction);  // from rest
    }
    const Num bound = Num(enough_) * scale_;
    Verdict verdict{correction <= bound, !(correction <= Num(largest) * scale_)};
    if (count_ < Sequences) verdict.done = Mask(false);  // from rest the first correction is exactly zero
    if (count_ <= Sequences) return verdict;
    const Num now = size(0), rate = now / size(Sequences);
    if (count_ == Sequences + 1) {
      verdict.done = verdict.done | ((now * max(rate, rate_) <= bound) & (rate_ < Num(quick)));
      rate_ = select(active, rate, rate_);
      begin_ = size(Sequences);
      best_ = now;
    } else {
      look_ahead(verdict, bound, now, rate);
      best_ = min(best_, now);
    }
    before_ = rate;
    return verdict;
  }

  int count() const { return count_; }
  const Num& first() const { return first_; }  ///< correction

  /// What is remembered from step to step.
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(rate_);
  }

 private:
  // The next correction shrinks as the last two did together. Corrections that shrink by less than half the way that
  // they went on average so far, and are small, are rounding. Where they are larger than is usual, it may be a mode
  // that a step does not resolve, and that hardly moves, which converges slowly, or not at all, after those that move:
  // rounding is what keeps its size.
  void look_ahead(Verdict& verdict, const Num& bound, const Num& now, const Num& rate) {
    const Num both = rate * before_;
    const Mask is_last = (now * now * both <= bound * bound) & (both < Num(quick * quick));
    const Mask is_small = now <= Num(small_) * scale_, is_rounding = now <= Num(last_bit_) * scale_;
    kept_ = select((rate >= Num(0.81)) & (now <= Num(16.0) * best_), kept_ + Num(1.0), Num(0.0));
    Mask stays = is_small & (min(rate, before_) >= Num(quick));
    stays = stays & ((now <= Num(usual_) * scale_) | (kept_ >= Num(double(certainly_))));
    if (any(stays)) stays = stays & (sqrt(rate) >= Num(0.5) + Num(0.5) * average());
    const Mask stalls = stays | (is_rounding & (rate * rate >= before_));
    verdict.done = verdict.done | is_last | stalls | (now == Num(0.0));
    if (count_ > 6) verdict.lost = verdict.lost | ((!is_small) & (rate > Num(1.0)) & (before_ > Num(1.0)));
  }

  // Rate of all corrections before this one, not squared.
  Num average() const {
    const double rates = double(count_ - 1 - Sequences) / Sequences;
    return exp(Num(0.5 / rates) * log(best_ / begin_));
  }

  // Of the last corrections but `back`, one of each sequence.
  Num size(std::size_t back) const {
    if constexpr (Sequences == 1) return last_[back];
    return max(last_[back], last_[back + 1]);
  }

  static double squared(double x) { return x * x; }

  static constexpr double largest = 1e4;  // the square of a correction that no step makes
  static constexpr double quick = 0.25;   // the square of a rate that is sure to go on
  static constexpr std::size_t known = 2 * Sequences;

  double enough_, last_bit_, usual_, small_;
  int certainly_;
  int count_ = 0;
  Num first_{0.0}, scale_{0.0}, begin_{0.0}, best_{0.0};
  Num rate_{1.0};    // of the second correction of a step to its first
  Num before_{1.0};  // the rate at the last one
  Num kept_{0.0};    // corrections in a row
  std::array<Num, known> last_{};
};

/// Sequences of the fixed point of a solver, which says so where they are not one.
template <class Solver>
constexpr int sequences_of() {
  if constexpr (requires { Solver::sequences; }) {
    return Solver::sequences;
  } else {
    return 1;
  }
}

}  // namespace pendula
