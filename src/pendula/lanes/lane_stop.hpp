#pragma once

#include <pendula/lanes/lane_pack.hpp>

namespace pendula {

/// Decides for every member when its fixed point has got where it goes, as RoundoffStop does for one: from the sizes of
/// its corrections, here squared and relative to the size of the step by `scale`, squared too.
template <class L>
class LaneStop {
 public:
  using Mask = typename L::Mask;

  /// `enough`: of a correction that need not be made any more, relative.
  explicit LaneStop(double enough) : enough_(enough * enough) {}

  /// Another member comes into a lane.
  void forget(int lane) { rate_.set(lane, 1); }

  /// A new step begins.
  void restart(const L& scale) {
    count_ = 0;
    scale_ = scale;
    last_[0] = last_[1] = last_[2] = L(0.0);
  }

  /// Takes the corrections just made; what has arrived, and what never will.
  struct Verdict {
    Mask done, lost;
  };
  Verdict judge(const L& correction, const Mask& active) {
    ++count_;
    last_[2] = last_[1];
    last_[1] = last_[0];
    last_[0] = correction;
    if (count_ == 1) {
      first_ = correction;
      scale_ = max(scale_, correction);  // from rest
    }
    const L bound = L(enough_) * scale_;
    Verdict verdict{correction <= bound, !(correction <= L(largest) * scale_)};
    if (count_ == 2) {
      const L rate = last_[0] / last_[1];
      verdict.done = verdict.done | ((last_[0] * max(rate, rate_) <= bound) & (rate_ < L(0.25)));
      rate_ = select(active, rate, rate_);
    }
    if (count_ >= 3) look_ahead(verdict, bound);
    return verdict;
  }

  int count() const { return count_; }
  const L& first() const { return first_; }  ///< correction

 private:
  // The next correction shrinks like the last two. Those that shrink by less than half the way that they once did, and
  // are small, are rounding.
  void look_ahead(Verdict& verdict, const L& bound) {
    const L rate = last_[0] / last_[1], before = last_[1] / last_[2];
    const L slower = max(rate, before);
    const Mask is_small = last_[0] <= L(small) * scale_, is_rounding = last_[0] <= L(rounding) * scale_;
    const Mask stalls = (is_small & (rate >= L(0.25)) & (before >= L(0.25))) | (is_rounding & (rate * rate >= before));
    verdict.done = verdict.done | ((last_[0] * slower <= bound) & (slower < L(0.25))) | stalls | (last_[0] == L(0.0));
    if (count_ > 6) verdict.lost = verdict.lost | ((!is_small) & (rate > L(1.0)) & (before > L(1.0)));
  }

  // Squares of what may be rounding at all, of a last bit, and of a correction that no step makes.
  static constexpr double small = 1e-18, rounding = 4.9e-32, largest = 1e4;

  double enough_;
  int count_ = 0;
  L first_{0.0}, scale_{0.0}, rate_{1.0};  // of the second correction of a step to its first
  L last_[3];
};

}  // namespace pendula
