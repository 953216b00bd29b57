#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <pendula/run/track.hpp>
#include <pendula/system/options.hpp>
#include <utility>

namespace pendula {

/// The accuracy wanted of a run, for every row and event. What error it expects in the end, trust.hpp says.
struct Accuracy {
  double error = 0;            ///< relative to the size and speed of the motion; 0: none, use the tolerance
  bool chooses_stages = true;  ///< by the tolerance; else the number of stages of the options is used
};

/// The tolerance by which a run reaches the wanted accuracy.
struct AccuracyAim {
  double tolerance = 0;
  /// Largest error along the motion with that tolerance; infinite where trials with the smallest tolerances diverge.
  double error = std::numeric_limits<double>::infinity();
  /// Track of the finest trial, which the run is compared with; empty if that trial failed.
  std::optional<Track> finest = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  /// Up to when that trial is as accurate as wanted  [s].
  double trusted_until = std::numeric_limits<double>::infinity();
  /// The distance of a trial by steps of another kind from the finest trial, where that does not shrink with the
  /// tolerance; and since when they differ  [s].
  double disputed = 0, disputed_from = std::numeric_limits<double>::infinity();
  double trials_end = 0;  ///< a run that goes on may end later  [s]

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(tolerance, error, trusted_until, disputed, disputed_from, trials_end);
  }
};

namespace detail {

/// Order of a method that does not choose its order.
inline int order_of(const RunOptions& options) {
  switch (options.method) {
    case Method::dopri5:
      return 5;
    case Method::fehlberg78:
      return 8;
    case Method::radau:
      return 2 * options.stages - 1;
    default:
      return 2 * options.stages;
  }
}

/// Whether rounding adds up from step to step: the state has no more digits than a double.
inline bool adds_up_rounding(Method method) {
  return is_explicit(method) && method != Method::taylor;
}

/// smallest_tolerance for the steps of one method.
inline double smallest_tolerance_of(Method method) {
  return adds_up_rounding(method) ? 1e-14 : smallest_tolerance;
}

/// The number of stages for steps by which a run has the wanted accuracy: their errors add up.
inline int stages_for_accuracy(Method method, double wanted) {
  return stages_for(method, 0.01 * wanted);
}

/// The smallest tolerances that trials use.
struct FinestTolerance {
  double good;      ///< where the accuracy may still be reached
  double hopeless;  ///< where it cannot be, so that a trial only tells up to when the motion is known
};

/// Limited by rounding. Where the order is given, also to about `most_steps` times the steps that the wanted accuracy
/// as a tolerance would take, unless more steps reach the accuracy.
inline FinestTolerance finest_tolerance(const RunOptions& options, const Accuracy& accuracy) {
  constexpr double most_steps = 4;
  const double rounding = smallest_tolerance_of(options.method);
  const double few_steps = std::max(rounding, accuracy.error * std::pow(most_steps, -order_of(options)));
  if (options.method == Method::taylor) return {rounding, rounding};
  if (!accuracy.chooses_stages) return {few_steps, few_steps};
  return {rounding, options.method == Method::gauss ? rounding : few_steps};
}

/// The errors found for two tolerances, the finer of which is good enough.
struct AccuracyLadder {
  AccuracyAim finest;         ///< the finest trial, which all others are compared with
  double factor = 0;          ///< error of the motion per tolerance
  bool can_be_finer = false;  ///< whether it is good enough and smaller tolerances are left
};

/// Two tolerances to compare, and the trial with the coarser one.
struct AccuracyRung {
  double coarse = 0, fine = 0;
  std::optional<Track> far = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
};

/// An error is reported only beyond this multiple of the wanted one: errors scatter about those seen in trials.
inline constexpr double close_to_wanted = 2;

/// The expected error may be `enough` times the wanted one; trials aim at `aimed_at` times it.
inline constexpr double enough = 0.3, aimed_at = 0.1;

/// By how much the start of a trial or of a second look is moved, in tolerances: no two runs start alike.
inline constexpr double start_share = 0.01;

/// Largest distance of two runs that still measures an error; beyond it they have diverged.
inline constexpr double together = 0.01;

/// Refines the tolerance until it is good enough. The motion amplifies the errors of steps by a factor, which grows
/// with chaos and is measured by trials: `run(tolerance)` returns the track of one, or nothing where it fails before
/// its end. The distance of two trials is the error of the coarser one; `apart(a, b)` is their Separation. If the finer
/// one is not expected to be good enough, or the distance is too large to measure a factor, a still finer trial is
/// compared with it. Errors scatter about tolerances by factors of ten and more, so that the aim lies below the wanted
/// error.
template <class RunTrial, class Apart>
AccuracyLadder refine_until_enough(double wanted, FinestTolerance smallest, double start, AccuracyRung from,
                                   RunTrial run, Apart apart) {
  constexpr double rounding = 2e-16;  // acts like a tolerance of this size
  auto& [coarse, fine, far] = from;
  for (;;) {
    std::optional<Track> near = run(fine);
    const double finer = std::max(fine, rounding) / coarse;  // error relative to the coarser trial
    std::optional<Separation> parted;
    if (far && near) parted.emplace(apart(*far, *near));
    const double off = parted ? parted->largest() : std::numeric_limits<double>::infinity();
    const double finest = smallest.good / coarse * off <= wanted ? smallest.good : smallest.hopeless;
    double next = fine / 1000;
    if (off <= together) {
      const double factor = off / coarse, error = finer * off;
      if (error <= enough * wanted) {
        return {{fine, error, std::move(near)}, factor, fine > std::max(rounding, smallest.good)};
      }
      if (fine <= finest) {
        return {{fine, error, std::move(near), parted->within(close_to_wanted * wanted / finer, start)}, factor};
      }
      next = std::min(aimed_at * wanted / factor, fine / 10);
    } else if (fine <= finest) {
      const double until = parted ? parted->within(close_to_wanted * wanted, start) : start;
      return {{fine, std::numeric_limits<double>::infinity(), std::move(near), until}};
    }
    coarse = fine;
    fine = std::max(next, finest);
    far = std::move(near);
  }
}

/// Coarsens the tolerance, to `coarsest` at most, since the finest one may be much better than needed: looks for a
/// tolerance whose trial differs from the finest trial by a fraction of the wanted error. `run` and `apart` are as
/// above. `factor` is raised to the largest one seen. Returns nothing if by that factor the finest tolerance is not
/// good enough, that is, if the ladder's factor was too small by chance.
template <class RunTrial, class Apart>
std::optional<AccuracyAim> coarsen_while_enough(double wanted, double coarsest, const AccuracyLadder& ladder,
                                                double& factor, RunTrial run, Apart apart) {
  constexpr double least = 0.03, most = 0.5, aimed = 0.15, step = 5, most_change = 100;
  constexpr int most_trials = 6;
  AccuracyAim best = ladder.finest;
  double tolerance = ladder.factor > 0 ? aimed * wanted / ladder.factor : coarsest;
  double low = step * best.tolerance, high = coarsest, before = 0;
  if (!(best.error <= wanted)) return best;
  for (int trial = 0; trial < most_trials && 2 * low < high; ++trial) {
    tolerance = std::clamp(tolerance, low, high);
    const std::optional<Track> there = run(tolerance);
    const double error = there ? apart(*there, *best.finest).largest() : std::numeric_limits<double>::infinity();
    if (error <= together) factor = std::max(factor, error / tolerance);
    if (ladder.can_be_finer && factor * ladder.finest.tolerance > wanted) return {};
    if (error <= most * wanted) best.tolerance = tolerance, best.error = error;
    if (error >= least * wanted && error <= most * wanted) break;
    (error > most * wanted ? high : low) = tolerance;
    const bool is_finest_trials = error < least * wanted && error < 1.5 * std::exchange(before, error);
    tolerance *= is_finest_trials ? most_change : std::clamp(aimed * wanted / error, 1 / most_change, most_change);
    if (tolerance <= low || tolerance >= high) tolerance = std::sqrt(low * high);
  }
  return best;
}

/// Options of a trial by steps of another kind, whose errors are others: what all steps of one kind get wrong alike
/// does not show in trials of that kind. Series are compared with Gauss steps. Implicit steps are compared with another
/// number of stages: what they do not damp then has the other sign.
inline RunOptions of_other_kind(RunOptions run, double wanted) {
  switch (run.method) {
    case Method::gauss:
      run.stages += run.stages < 8 ? 1 : -1;
      return run;
    case Method::radau:  // Gauss steps do not damp what these do
      run.stages = run.stages == 3 ? 2 : 3;
      return run;
    case Method::dopri5:
      run.method = Method::fehlberg78;
      return run;
    default:
      run.method = Method::gauss;
      run.stages = stages_for_accuracy(run.method, wanted);
      run.step = 0;
      return run;
  }
}

/// Compares the finest trial with others by steps of another kind. `run(tolerance)` makes one of them, and returns
/// nothing where it does not come to its end in time; it then says nothing. The smaller their tolerance, the closer
/// they have to come to the finest trial; where they come no closer than `near`, that is the error.
template <class RunTrial, class Apart>
void hear_another(double wanted, double start, AccuracyAim& aim, double tolerance, RunTrial run, Apart apart) {
  constexpr double near = 0.5, closer = 0.3;  // of the wanted error; of the distance before
  constexpr int most_trials = 3;
  double before = std::numeric_limits<double>::infinity();
  for (int trial = 0; trial < most_trials && tolerance >= smallest_tolerance; ++trial) {
    const std::optional<Track> there = run(tolerance);
    if (!there) return;
    const Separation parted = apart(*there, *aim.finest);
    const double off = parted.largest();
    if (off <= close_to_wanted * wanted) {
      if (off > near * wanted) aim.error = std::max(aim.error, off);
      return;
    }
    if (off > closer * before) {
      aim.disputed = off;
      aim.disputed_from = parted.within(close_to_wanted * wanted, start);
      return;
    }
    before = off;
    tolerance *= off <= together ? std::max(aimed_at * wanted / off, 1e-3) : 1e-3;
  }
}

/// Refines the tolerance by trials of `run` until it is good enough, then coarsens it by trials of `run_alike` as far
/// as possible.
template <class RunTrial, class RunAlike, class Apart>
AccuracyAim find_aim(double wanted, double coarsest, FinestTolerance smallest, double start, RunTrial run,
                     RunAlike run_alike, Apart apart) {
  constexpr double step = 100, coarsest_trial = 1e-3;
  AccuracyRung rung;
  rung.coarse = std::max(std::min(step * wanted, coarsest_trial), step * smallest.good);
  rung.fine = rung.coarse / step;
  rung.far = run(rung.coarse);
  for (;;) {
    AccuracyLadder ladder = refine_until_enough(wanted, smallest, start, std::move(rung), run, apart);
    double factor = ladder.factor;
    if (std::optional<AccuracyAim> aim = coarsen_while_enough(wanted, coarsest, ladder, factor, run_alike, apart))
      return *aim;
    const double known = ladder.finest.tolerance, finer = std::min(aimed_at * wanted / factor, known / 10);
    rung = {known, std::max(finer, smallest.good), std::move(ladder.finest.finest)};
  }
}

}  // namespace detail
}  // namespace pendula
