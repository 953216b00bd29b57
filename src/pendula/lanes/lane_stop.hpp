#pragma once

#include <pendula/lanes/lane_pack.hpp>

namespace pendula {

/// Decides for every member when its fixed point has got where it goes, as RoundoffStop does for one: from the sizes of
/// its corrections, here squared and relative to the size of the step by `scale`, squared too.
///
/// A fixed point on rates and forces is two interleaved sequences: then corrections are looked at in pairs, and their
/// rate is that of two iterations.
template <class L, int Sequences = 1>
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
    for (L& last : last_) last = L(0.0);
  }

  /// Takes the corrections just made; what has arrived, and what never will.
  struct Verdict {
    Mask done, lost;
  };
  Verdict judge(const L& correction, const Mask& active) {
    ++count_;
    for (std::size_t k = known - 1; k > 0; --k) last_[k] = last_[k - 1];
    last_[0] = correction;
    if (count_ == 1) {
      first_ = correction;
      scale_ = max(scale_, correction);  // from rest
    }
    const L bound = L(enough_) * scale_;
    Verdict verdict{correction <= bound, !(correction <= L(largest) * scale_)};
    if (count_ <= Sequences) return verdict;
    const L now = size(0), rate = now / size(Sequences);
    if (count_ == Sequences + 1) {
      verdict.done = verdict.done | ((now * max(rate, rate_) <= bound) & (rate_ < L(0.25)));
      rate_ = select(active, rate, rate_);
    } else {
      look_ahead(verdict, bound, now, rate);
    }
    before_ = rate;
    return verdict;
  }

  int count() const { return count_; }
  const L& first() const { return first_; }  ///< correction

 private:
  // The next correction shrinks like the last two. Those that shrink by less than half the way that they once did, and
  // are small, are rounding; those that are larger than usual have to stay where they are, as RoundoffStop says.
  void look_ahead(Verdict& verdict, const L& bound, const L& now, const L& rate) {
    const L slower = max(rate, before_);
    const Mask is_small = now <= L(small) * scale_, is_rounding = now <= L(rounding) * scale_;
    const Mask is_usual = now <= L(usual) * scale_;
    const Mask stays = is_small & (rate >= L(0.25)) & (before_ >= L(0.25)) & (is_usual | (rate >= L(0.81)));
    const Mask stalls = stays | (is_rounding & (rate * rate >= before_));
    verdict.done = verdict.done | ((now * slower <= bound) & (slower < L(0.25))) | stalls | (now == L(0.0));
    if (count_ > 6) verdict.lost = verdict.lost | ((!is_small) & (rate > L(1.0)) & (before_ > L(1.0)));
  }

  // Of the last corrections but `back`, one of each sequence.
  L size(std::size_t back) const {
    if constexpr (Sequences == 1) return last_[back];
    return max(last_[back], last_[back + 1]);
  }

  // Squares of what may be rounding at all, of what it usually is, of a last bit, and of a correction that no step
  // makes.
  static constexpr double small = 1e-18, usual = 1e-24, rounding = 4.9e-32, largest = 1e4;

  double enough_;
  int count_ = 0;
  L first_{0.0}, scale_{0.0}, rate_{1.0};  // of the second correction of a step to its first
  L before_{1.0};                          // the rate at the last one
  static constexpr std::size_t known = 2 * Sequences;
  L last_[known];
};

}  // namespace pendula
