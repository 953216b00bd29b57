#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/gauss/step_controller.hpp>
#include <pendula/lanes/lane_pack.hpp>

namespace pendula {

/// Chooses the steps of every member by a tolerance, as StepController does. With symmetric steering: a density of
/// steps that follows the member's pace, and a scale that changes where a step errs by too much or many err by less; of
/// members with loads, by the error of the last step. Errors are compared by their logarithms.
template <class L, int S>
class LaneController {
 public:
  using Mask = typename L::Mask;

  explicit LaneController(double tolerance)
      : tolerance_(tolerance),
        log_tolerance_(std::log(tolerance)),
        first_scale_(std::min(1.0, std::exp(log_tolerance_ / order))) {}

  /// Members that start, at the tempo of the stepper's chain.
  template <class Stepper>
  void start(const Mask& which, Stepper& stepper) {
    L pace, quickening;
    stepper.chain().tempo(pace, quickening);
    scale_ = select(which, L(first_scale_), scale_);
    last_ = select(which, L(0.0), last_);
    start_density(which, select(pace > L(0.0), pace, L(1.0)), quickening);
    largest_ = select(which, L(never), largest_);
    steps_ = select(which, L(0.0), steps_);
    length_ = select(which, L(1.0), length_);
    if constexpr (has_loads<Stepper>) longest_ = select(which, stepper.chain().longest_step(tolerance_), longest_);
  }

  /// Of the next step, unless the run ends before.
  template <class Stepper>
  L step(Stepper& /*stepper*/) const {
    const L step = min(longest_, scale_ / density_);
    return select(last_ > L(0.0), min(step, most_growth * last_), step);
  }

  /// Which of the steps `h` that were solved are good enough; those that are not get a shorter one.
  template <class Stepper>
  Mask accepts(const Mask& which, const L& h, Stepper& stepper) {
    const auto decay = [&](int k) { return stepper.chain().decay(k); };
    const L squared = max(stepper.chain().pace_squared(), L(tiny)), size = 0.5 * log(squared);
    log_error_ = log_error(decay, squared, size) + L(std::log(safety)) - max(size, L(std::log(shortest)));
    L log_excess = log_error_ - L(log_tolerance_);
    if constexpr (requires { stepper.chain().imbalance(); }) {
      log_excess = max(log_excess, log_imbalance(stepper.chain().imbalance(), max(sqrt(squared), L(shortest))));
    }
    const Mask good = log_excess <= L(0.0);
    const Mask bad = which & !good;
    if (xsimd::any(bad)) {
      const L factor = max(L(0.2), 0.9 * exp(log_excess * L(-1.0 / order)));
      shrink(bad, h, select(factor > L(0.2), factor, L(0.2)));
    }
    return which & good;
  }

  /// The next step of these members is to be `factor` of the one that failed.
  void shrink(const Mask& which, const L& h, const L& factor) {
    scale_ = select(which, factor * h * density_, scale_);
    largest_ = select(which, L(never), largest_);
    steps_ = select(which, L(0.0), steps_);
  }

  /// Steps h that were chosen were taken.
  template <class Stepper>
  void move_on(const Mask& which, const L& h, Stepper& stepper) {
    L pace, quickening;
    stepper.chain().tempo(pace, quickening);
    last_ = select(which, h, last_);
    Mask symmetric = which;
    if constexpr (has_loads<Stepper>) {
      const Mask loaded = which & stepper.chain().loaded();
      if (xsimd::any(loaded)) follow_error(loaded, h);
      symmetric = which & !loaded;
    }
    const L next = fma(scale_, quickening, density_);
    const Mask follows = (next < farthest * pace) & (farthest * next > pace);
    density_ = select(symmetric & follows, next, density_);
    start_density(symmetric & !follows, pace, quickening);
    watch(symmetric);
  }

 private:
  static constexpr int order = 2 * S;
  template <class Stepper>
  static constexpr bool has_loads = requires(Stepper& stepper) {
    stepper.chain().loaded();
  };

  void follow_error(const Mask& which, const L& h) {
    const L growth = exp((L(std::log(greedy_aim) + log_tolerance_) - log_error_) * L(1.0 / order));
    scale_ = select(which, h * density_ * min(max(growth, L(least_growth)), L(greedy_growth)), scale_);
  }

  // Of the energy that is missing, by how much it is more than it may be in a step that goes on by so much.
  L log_imbalance(const L& imbalance, const L& moved) const {
    const L most = max(L(most_imbalance * tolerance_) * moved, L(energy_rounding));
    return log(max(imbalance, L(tiny)) / most);
  }

  void start_density(const Mask& which, const L& pace, const L& quickening) {
    const L change = 0.5 * (scale_ * quickening);
    density_ = select(which, pace + max(-0.5 * pace, min(change, pace)), density_);
  }

  void watch(const Mask& which) {
    largest_ = select(which, max(largest_, log_error_), largest_);
    steps_ = select(which, steps_ + L(1.0), steps_);
    const Mask seen = which & (steps_ >= length_);
    if (!xsimd::any(seen)) return;
    const L growth = exp(min((L(std::log(aim) + log_tolerance_) - largest_) * L(1.0 / order), L(2.0)));
    scale_ = select(seen & (growth > L(worthwhile)), scale_ * min(growth, L(most_growth)), scale_);
    largest_ = select(seen, L(never), largest_);
    steps_ = select(seen, L(0.0), steps_);
    length_ = select(seen, 2.0 * length_, length_);
  }

  // StepShape::error, from the squares of the coefficients and (h R)²; moved: log h R.
  template <class Decay>
  static L log_error(Decay decay, const L& moved_squared, const L& moved) {
    if constexpr (S == 1) {
      return 3.0 * moved;
    } else {
      const L noise = moved + L(std::log(rounding));
      const L largest_squared = max(max(decay(0), decay(1) / min(moved_squared, L(1.0))), L(tiny));
      const L size = min(moved, 0.5 * log(largest_squared) + L(std::log(small)));
      const L last = max(decay(S - 1), L(tiny)), log_last = 0.5 * log(last);
      L error = extended(log_last, size, noise, S - 1);
      if constexpr (S >= 3) {
        const L next = max(decay(S - 2), L(tiny)), log_next = 0.5 * log(next);
        error = max(error, extended(log_next, size, noise, S - 2));
        if constexpr (S >= 4) {
          const L before = max(decay(S - 3), L(tiny)) + decay(S - 4);
          const L ratio = min(L(0.0), 0.25 * log((last + next) / before));
          const L largest = max(log_last, ratio + log_next);
          error = select(error > L(never), max(error, fma(ratio, L(double(order - S + 1)), largest)), error);
        }
      }
      return error;
    }
  }
  static L extended(const L& coefficient, const L& size, const L& noise, int k) {
    const L error = fma(coefficient - size, L((order - k) / double(k)), coefficient);
    return select(coefficient > noise, error, L(never));
  }

  // StepController's.
  static constexpr double safety = 4, shortest = 1e-3, aim = 0.2, most_growth = 4, worthwhile = 1.05, farthest = 2;
  static constexpr double most_imbalance = 5, energy_rounding = 1e-13;
  static constexpr double greedy_aim = 0.03, greedy_growth = 1.5, least_growth = 0.3;
  static constexpr double rounding = 1e-13, small = 10;
  static constexpr double never = -700, tiny = 1e-300;  // a logarithm below all errors; in place of zero

  double tolerance_, log_tolerance_, first_scale_;
  L scale_{1.0}, density_{1.0}, last_{0.0}, longest_{std::numeric_limits<double>::infinity()};
  L log_error_{never};
  L largest_{never}, steps_{0.0}, length_{1.0};  // of the errors since the scale was last looked at
};

}  // namespace pendula
