#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/numeric/numeric.hpp>
#include <utility>

namespace pendula {

/// How a controller chooses the next step.
enum class Steering {
  symmetric,  ///< by a density of steps that is reversible: no drift, and a reversed run returns
  greedy      ///< by the error of the last step alone: for motion that gains or loses energy anyway
};

/// Chooses the steps of a Gauss or Radau method, of one motion or of several, so that the error of each is at most the
/// tolerance. Errors are held as logarithms.
///
/// Symmetric steps are h = c/ρ, where the density ρ follows the pace R of the motion,
///   ρ₊ = ρ₋ + c d ln R/dt,
/// from the step before a state to the one after it, with the derivative at that state (Hairer and Söderlind, SIAM J.
/// Sci. Comput. 26 (2005) 1838). Backwards that is the same recursion. The tolerance decides on c: it becomes smaller
/// where the error of a step is too large, and larger where those of all of the last 2^k steps were small. k grows with
/// each such look, so that c changes less and less often.
template <class Num>
class StepController {
 public:
  using Mask = MaskOf<Num>;

  StepController(int stages, int order, double tolerance, Steering steering = Steering::symmetric)
      : stages_(stages),
        order_(order),
        tolerance_(tolerance),
        log_tolerance_(std::log(tolerance)),
        first_scale_(std::min(1.0, std::exp(log_tolerance_ / order))),
        greedy_(steering == Steering::greedy) {}

  bool chooses() const { return tolerance_ > 0; }

  /// From now on these motions have greedy steps, or symmetric ones.
  void steer(const Mask& which, const Mask& greedily) { greedy_ = (which & greedily) | (greedy_ & !which); }

  /// These motions start, at this tempo.
  void start(const Mask& which, const TempoOf<Num>& tempo) {
    const Mask moves = tempo.pace > Num(0.0);
    scale_ = select(which, Num(first_scale_), scale_);
    last_step_ = select(which, Num(0.0), last_step_);
    start_density(which, {select(moves, tempo.pace, Num(1.0)), select(moves, tempo.quickening, Num(0.0))});
    forget_errors(which);
    window_.length = select(which, Num(1.0), window_.length);
  }

  /// The size of the next step, unless the run ends before.
  Num step() const {
    const Num step = scale_ / density_;
    return select(last_step_ > Num(0.0), min(step, Num(most_growth) * last_step_), step);
  }

  /// Returns which of the solved steps of size h are good enough. Where one is not, the next try is smaller.
  Mask accepts(const Mask& which, const StepDecay<Num>& decay, const Num& h) {
    log_error_ = decay.log_error(stages_, order_) + Num(std::log(safety));
    Num log_excess = log_error_ - Num(log_tolerance_);
    if (!all(decay.imbalance == Num(0.0))) {
      const Num most = max(Num(most_imbalance * tolerance_) * decay.time(), Num(energy_rounding));
      log_excess = max(log_excess, log(max(decay.imbalance, Num(detail::almost_zero)) / most));
    }
    const Mask sees_start = decay.log_unseen(stages_) <= Num(log_tolerance_ - std::log(safety));
    const Mask good = (log_excess <= Num(0.0)) & sees_start;
    const Mask bad = which & !good;
    if (any(bad)) {
      const Num factor = Num(cautious) * exp(log_excess * Num(-1.0 / order_));
      shrink(bad, h, select((factor > Num(least_shrinking)) & sees_start, factor, Num(least_shrinking)));
    }
    return which & good;
  }

  /// The next steps of these are to be `factor` of those that failed.
  void shrink(const Mask& which, const Num& h, const Num& factor) {
    scale_ = select(which, factor * h * density_, scale_);
    forget_errors(which);
  }

  /// Call when steps of size h that the controller chose were taken. tempo() is that of the state where they ended.
  template <class FindTempo>
  void move_on(const Mask& which, const Num& h, FindTempo tempo) {
    last_step_ = select(which, h, last_step_);
    const Mask greedy = which & greedy_, symmetric = which & !greedy_;
    if (any(greedy)) follow_error(greedy, h);
    if (!any(symmetric)) return;
    follow(symmetric, tempo());
    watch(symmetric);
  }

  /// The motion is reversed where it is: the densities before and after it change places.
  void turn_back() { std::swap(density_, density_before_); }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(scale_, density_, density_before_, last_step_, window_.largest_error, window_.steps, window_.length);
  }

 private:
  static constexpr double never = StepDecay<Num>::never;

  // The errors of the steps since c was last looked at, their number, and how many are looked at together.
  struct Window {
    Num largest_error{never}, steps{0.0}, length{1.0};
  };

  // The factor by which a step has to change so that its error becomes `wanted` times the tolerance; at most e².
  Num growth(double wanted, const Num& log_error) const {
    return exp(min((Num(std::log(wanted) + log_tolerance_) - log_error) * Num(1.0 / order_), Num(2.0)));
  }

  void follow_error(const Mask& which, const Num& h) {
    const Num factor = min(max(growth(greedy_aim, log_error_), Num(least_growth)), Num(greedy_growth));
    scale_ = select(which, h * density_ * factor, scale_);
  }

  // Where the density is far from the pace, it starts anew: a reversed run does not repeat that, but it is rare.
  void follow(const Mask& which, const TempoOf<Num>& tempo) {
    const Num next = fma(scale_, tempo.quickening, density_);
    const Mask near = (next < Num(farthest) * tempo.pace) & (Num(farthest) * next > tempo.pace);
    density_before_ = select(which, density_, density_before_);
    density_ = select(which, next, density_);
    if (any(which & !near)) start_density(which & !near, tempo);
  }

  // Sets the densities half a step before and after the state.
  void start_density(const Mask& which, const TempoOf<Num>& tempo) {
    const Num change = Num(0.5) * (scale_ * tempo.quickening);
    const Num within = max(Num(-0.5) * tempo.pace, min(change, tempo.pace));
    density_before_ = select(which, tempo.pace - within, density_before_);
    density_ = select(which, tempo.pace + within, density_);
  }

  void watch(const Mask& which) {
    window_.largest_error = select(which, max(window_.largest_error, log_error_), window_.largest_error);
    window_.steps = select(which, window_.steps + Num(1.0), window_.steps);
    const Mask seen = which & (window_.steps >= window_.length);
    if (!any(seen)) return;
    const Num larger = growth(aim, window_.largest_error);
    scale_ = select(seen & (larger > Num(worthwhile)), scale_ * min(larger, Num(most_growth)), scale_);
    forget_errors(seen);
    window_.length = select(seen, Num(2.0) * window_.length, window_.length);
  }

  void forget_errors(const Mask& which) {
    window_.largest_error = select(which, Num(never), window_.largest_error);
    window_.steps = select(which, Num(0.0), window_.steps);
  }

  // By this factor errors grow on their way to the end of a run, as measured on random chains.
  static constexpr double safety = 4;
  static constexpr double aim = 0.2;  // of the tolerance, where c is set
  // Energy error that is allowed, in tolerances. Stages may show no error where motion is singular between them.
  static constexpr double most_imbalance = 5, energy_rounding = 1e-13;
  static constexpr double greedy_aim = 0.03, greedy_growth = 1.5, least_growth = 0.3;
  static constexpr double most_growth = 4, worthwhile = 1.05;
  static constexpr double cautious = 0.9, least_shrinking = 0.2;  // of the step after one that was too large
  static constexpr double farthest = 2;                           // of the density from the pace

  int stages_, order_;
  double tolerance_, log_tolerance_, first_scale_;
  Mask greedy_;
  Num scale_{1.0}, density_{1.0}, density_before_{0.0};
  Num last_step_{0.0};    // of the controller's choice; 0: there was none
  Num log_error_{never};  // logarithm of the error of the last step that was solved
  Window window_;
};

}  // namespace pendula
