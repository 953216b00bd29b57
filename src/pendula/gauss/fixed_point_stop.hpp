#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// Sizes of the corrections of a fixed point, relative to the size of the step.
struct CorrectionLimits {
  double enough = 1e-18;  ///< of the first correction that is left out: far below a last bit
  double last_bit = std::numeric_limits<double>::epsilon();
  double usual = 1e-12;  ///< corrections usually stop shrinking here
  double small = 1e-9;   ///< no iteration that converges stops shrinking above this
  int certainly = 1;     ///< how often in a row larger ones have to keep their size before they count as rounding
};

/// Decides when the fixed-point iteration of one motion, or of each of several, has reached round-off. It is given the
/// squares of its corrections, and of the size of the step, `scale`.
///
/// An iteration stops where the *next* correction would be far below round-off, or where corrections no longer follow
/// their own rate of convergence, because only rounding is left (Hairer, McLachlan, Razakarivony 2008;
/// arXiv:1702.03354). A fixed tolerance may never be met by a long chain. Stopping at the first correction of a few ulp
/// leaves out a remainder of the same sign step after step, by which the energy drifts.
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
        expected_(usual_),
        small_(squared(limits.small)),
        certainly_(limits.certainly) {}

  /// Another motion takes the place of this member.
  void forget(int member) { set(rate_, member, 1); }

  /// A new step begins.
  void restart(const Num& scale) {
    count_ = 0;
    expected_ = usual_;
    scale_ = scale;
    kept_ = Num(0.0);
    last_.fill(Num(0.0));
  }

  /// From now on in this step, corrections of this size may be rounding, even if usual ones are smaller.
  void expect(double rounding) { expected_ = std::max(expected_, squared(rounding)); }

  /// Takes the corrections just made, squared. Verdict: which iterations are done, and which will not converge.
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

  /// Visits the numbers that are remembered from step to step.
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(rate_);
  }

 private:
  // The next correction is expected to shrink as the last two did together. Small corrections whose rate is nearer to 1
  // than to the average so far are rounding. Where they are larger than usual, they may belong to a mode that hardly
  // moves and converges slowly, because the step does not resolve it; only rounding keeps its size.
  void look_ahead(Verdict& verdict, const Num& bound, const Num& now, const Num& rate) {
    const Num both = rate * before_;
    const Mask is_last = (now * now * both <= bound * bound) & (both < Num(quick * quick));
    const Mask is_small = now <= Num(std::max(small_, expected_)) * scale_,
               is_rounding = now <= Num(last_bit_) * scale_;
    kept_ = select((rate >= Num(0.81)) & (now <= Num(16.0) * best_), kept_ + Num(1.0), Num(0.0));
    Mask stays = is_small & (min(rate, before_) >= Num(quick));
    stays = stays & ((now <= Num(expected_) * scale_) | (kept_ >= Num(double(certainly_))));
    if (any(stays)) stays = stays & (sqrt(rate) >= Num(0.5) + Num(0.5) * average());
    const Mask stalls = stays | (is_rounding & (rate * rate >= before_));
    verdict.done = verdict.done | is_last | stalls | (now == Num(0.0));
    if (count_ > 6) verdict.lost = verdict.lost | ((!is_small) & (rate > Num(1.0)) & (before_ > Num(1.0)));
  }

  // The average rate of the corrections before this one, not squared; 1 where the first one was the smallest, as in a
  // step so short that nothing but rounding is left to correct.
  Num average() const {
    const double rates = double(count_ - 1 - Sequences) / Sequences;
    return exp(Num(0.5 / rates) * min(log(best_ / begin_), Num(0.0)));
  }

  // The square of the correction `back` iterations ago; with two sequences the larger of it and the one before.
  Num size(std::size_t back) const {
    if constexpr (Sequences == 1) return last_[back];
    return max(last_[back], last_[back + 1]);
  }

  static double squared(double x) { return x * x; }

  static constexpr double largest = 1e4;  // the square of a correction that no step makes
  static constexpr double quick = 0.25;   // the square of a rate that is sure to go on
  static constexpr std::size_t known = 2 * Sequences;

  double enough_, last_bit_, usual_, expected_, small_;
  int certainly_;
  int count_ = 0;
  Num first_{0.0}, scale_{0.0}, begin_{0.0}, best_{0.0};
  Num rate_{1.0};    // of the second correction of a step to its first
  Num before_{1.0};  // the rate at the last one
  Num kept_{0.0};    // corrections in a row that kept their size
  std::array<Num, known> last_{};
};

/// FixedPointStop's Sequences for a solver: Solver::sequences, or 1 if it has no such member.
template <class Solver>
constexpr int sequences_of() {
  if constexpr (requires { Solver::sequences; }) {
    return Solver::sequences;
  } else {
    return 1;
  }
}

}  // namespace pendula
