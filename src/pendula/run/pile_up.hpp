#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace pendula {

/// Whether a motion switches ever faster and ever closer to where it switches, without end: a preloaded detent with a
/// viscous damper does, whose n-th swing takes 1/n as long and gets 1/n² as far. Switchings are counted in blocks, each
/// as many as all before it.
class PileUp {
 public:
  void begin(double time, std::size_t functions) {
    count_ = 0;
    begin_ = time;
    lasted_ = 0;
    whole_.assign(functions, 0);
    here_ = before_ = whole_;
  }

  /// Values of the switching functions between two switchings.
  void reach(const std::vector<double>& values) {
    for (std::size_t k = 0; k < values.size(); ++k) {
      here_[k] = std::max(here_[k], std::abs(values[k]));
      whole_[k] = std::max(whole_[k], here_[k]);
    }
  }

  /// Counts a switching by function `k`. Returns whether they will not end.
  bool count(double time, std::size_t k) {
    constexpr std::int64_t first = 256;
    constexpr double as_long = 1.2, nearer = 0.5, close = 1e-6;
    if (++count_ < first || (count_ & (count_ - 1)) != 0) return false;
    const double lasts = time - begin_;
    const bool is_endless = count_ >= 4 * first && lasts <= as_long * lasted_ && here_[k] <= nearer * before_[k] &&
                            here_[k] <= close * whole_[k];
    begin_ = time;
    lasted_ = lasts;
    before_ = here_;
    std::fill(here_.begin(), here_.end(), 0);
    return is_endless;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(count_, begin_, lasted_, whole_, here_, before_);
  }

 private:
  std::int64_t count_ = 0;
  double begin_ = 0, lasted_ = 0;  // of this block  [s]; the one before  [s]
  std::vector<double> whole_, here_,
      before_;  // how far functions get from zero: ever; in this block; in the one before
};

}  // namespace pendula
