#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <pendula/gauss/step_shape.hpp>
#include <utility>

namespace pendula {

/// How steps of its own choice follow the motion.
enum class Steering {
  symmetric,  ///< by a density of steps that goes forward as it goes back: no drift, and a reversed run returns
  greedy      ///< by the error of the last step alone: for motion that takes or gives energy anyway
};

/// Chooses the steps of a method of even or odd order, so that each errs by no more than a tolerance.
///
/// Symmetric steps are h = c/ρ, where the density ρ follows the pace R of the motion,
///   ρ₊ = ρ₋ + c d ln R/dt,
/// from the step before a state to the one after it, the derivative being that of the state (Hairer and Söderlind,
/// SIAM J. Sci. Comput. 26 (2005) 1838). Backwards that is the same recursion. What a tolerance asks for is c, which
/// changes seldom, the rarer the longer the run: where a step errs by more, and where all of the last 2^k erred by
/// less.
class StepController {
 public:
  StepController(int stages, int order, double tolerance, Steering steering)
      : stages_(stages), order_(order), tolerance_(tolerance), steering_(steering) {}

  bool chooses() const { return tolerance_ > 0; }

  /// A run starts, at this tempo.
  void start(const Tempo& tempo) {
    scale_ = first_scale();
    last_step_ = 0;
    start_density(tempo.pace > 0 ? tempo : Tempo{1, 0});
    window_ = {};
  }

  /// Of the next step, unless the run ends before.
  double step() const {
    const double step = scale_ / density_;
    return last_step_ == 0 ? step : std::min(step, most_growth * last_step_);
  }

  /// Whether a step of size h that was solved is good enough; if not, the next one is smaller.
  bool accepts(const StepShape& shape, double h) {
    const double time = std::max(h * shape.pace, shortest);
    error_ = shape.pace > 0 ? safety * shape.error(h, stages_, order_) / time : 0;
    const double off = shape.imbalance / std::max(most_imbalance * tolerance_ * time, energy_rounding);
    const double excess = std::max(error_ / tolerance_, off);
    if (excess <= 1) return true;
    shrink(h, std::max(0.2, 0.9 * root(1 / excess)));
    return false;
  }

  /// The next step is to be `factor` of one that failed.
  void shrink(double h, double factor) {
    scale_ = factor * h * density_;
    window_.largest_error = 0;
    window_.steps = 0;
  }

  /// A step of size h that the controller chose was taken. tempo() is that of the state where it ended.
  template <class TempoOf>
  void move_on(double h, TempoOf tempo) {
    last_step_ = h;
    if (steering_ == Steering::greedy) {
      scale_ = h * density_ * std::clamp(root(greedy_aim * tolerance_ / error_), 0.3, greedy_growth);
      return;
    }
    follow(tempo());
    watch();
  }

  /// The motion is reversed where it is: what is remembered of the density goes the other way.
  void turn_back() { std::swap(density_, density_before_); }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(scale_, density_, density_before_, last_step_, window_.largest_error, window_.steps, window_.length);
  }

 private:
  // The errors of the steps since c was last looked at.
  struct Window {
    double largest_error = 0;
    std::int64_t steps = 0, length = 1;
  };

  double root(double ratio) const { return std::pow(ratio, 1.0 / order_); }

  double first_scale() const { return std::min(1.0, root(tolerance_)); }

  // The density is brought back where it has lost the pace: that a run does not retrace, and is rare.
  void follow(const Tempo& tempo) {
    const double next = density_ + scale_ * tempo.quickening;
    if (!(next < farthest * tempo.pace) || !(next * farthest > tempo.pace)) return start_density(tempo);
    density_before_ = density_;
    density_ = next;
  }

  // Half a step on from the state.
  void start_density(const Tempo& tempo) {
    const double change = std::clamp(scale_ * tempo.quickening / 2, -tempo.pace / 2, tempo.pace);
    density_before_ = tempo.pace - change;
    density_ = tempo.pace + change;
  }

  void watch() {
    window_.largest_error = std::max(window_.largest_error, error_);
    if (++window_.steps < window_.length) return;
    const double growth = window_.largest_error == 0 ? most_growth : root(aim * tolerance_ / window_.largest_error);
    if (growth > worthwhile) scale_ *= std::min(growth, most_growth);
    window_ = {0, 0, 2 * window_.length};
  }

  // What errors grow by on their way to the end of a run, as measured on random chains.
  static constexpr double safety = 4;
  // Of a step, in the time in which motion changes: where it only begins, nothing says how fast it will be.
  static constexpr double shortest = 1e-3;
  static constexpr double aim = 0.2;  // of the tolerance, where c is set
  // Of energy, in tolerances, as long as stages say that all is well: what they stand beside they do not see.
  static constexpr double most_imbalance = 5, energy_rounding = 1e-13;
  static constexpr double greedy_aim = 0.03, greedy_growth = 1.5;
  static constexpr double most_growth = 4, worthwhile = 1.05;
  static constexpr double farthest = 2;  // of the density from the pace

  int stages_, order_;
  double tolerance_;
  Steering steering_;
  double scale_ = 1, density_ = 1, density_before_ = 0;
  double last_step_ = 0;  // of the controller's choice; 0: there was none
  double error_ = 0;      // of the last step that was solved
  Window window_;
};

}  // namespace pendula
