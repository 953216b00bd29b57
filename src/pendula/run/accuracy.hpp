#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <pendula/run/track.hpp>
#include <pendula/system/options.hpp>
#include <utility>

namespace pendula {

/// What is wanted of a run, of every row and event.
struct Accuracy {
  double error = 0;            ///< relative to the size and the speed of the motion; 0: what the tolerance makes of it
  bool chooses_stages = true;  ///< as many as the tolerance wants; else those of the options
};

/// By which tolerance a run is as accurate as is wanted.
struct AccuracyAim {
  double tolerance = 0;
  /// Error by that tolerance, the largest along the motion; infinite where trials by the smallest ones part.
  double error = std::numeric_limits<double>::infinity();
  /// The finest trial, which the run is compared with; nothing where that has no states.
  std::optional<Track> finest = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  /// Up to where that is as accurate as is wanted  [s].
  double trusted_until = std::numeric_limits<double>::infinity();

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(tolerance, error);
  }
};

namespace detail {

/// Order of steps of a method that does not choose it.
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

/// The smallest tolerances that steps are chosen by.
struct FinestTolerance {
  double good;      ///< where it may be good enough
  double hopeless;  ///< where none is, so that it only tells up to when the motion is known
};

/// Rounding allows so much; and an order that is given no more than some steps for each of a run by the accuracy
/// itself, unless more of them lead to the accuracy.
inline FinestTolerance finest_tolerance(const RunOptions& options, const Accuracy& accuracy) {
  constexpr double most_steps = 4;
  const double rounding = is_explicit(options.method) ? 1e-14 : 1e-16;
  const double few_steps = std::max(rounding, accuracy.error * std::pow(most_steps, -order_of(options)));
  const bool chooses_order = options.method == Method::bulirsch_stoer || options.method == Method::taylor;
  if (chooses_order) return {rounding, rounding};
  if (!accuracy.chooses_stages) return {few_steps, few_steps};
  return {rounding, options.method == Method::gauss ? rounding : few_steps};
}

/// What is known of the errors by two tolerances of which the finer one is good enough.
struct AccuracyLadder {
  AccuracyAim finest;         ///< which all others are compared with
  double factor = 0;          ///< what the motion makes of a tolerance
  bool can_be_finer = false;  ///< whether it is good enough, and smaller tolerances are left to try
};

/// Two tolerances to compare, and the trial by the coarser one.
struct AccuracyRung {
  double coarse = 0, fine = 0;
  std::optional<Track> far = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
};

/// How far rows may be off what was wanted and not be told: errors scatter about what was seen in trials.
inline constexpr double close_to_wanted = 2;

/// What the error that is expected may be of the one that is wanted, and what it is aimed at.
inline constexpr double enough = 0.3, aimed_at = 0.1;

/// What runs are off each other by, at most, that still tell errors.
inline constexpr double together = 0.01;

/// What a motion makes of the errors of its steps is a factor that grows with chaos. Trials tell it: `run(tolerance)`
/// is the track of one, nothing where a run does not come to its end. Two of them part by the error of the coarser one;
/// `apart(a, b)` is a Separation. Where the finer one is not expected to be good enough, or they part too far for a
/// factor, the next is finer, and is compared with it. Errors scatter about what tolerances ask for by factors of ten
/// and more, so that aims lie below what is wanted.
template <class RunTrial, class Apart>
AccuracyLadder climb_down(double wanted, FinestTolerance smallest, double start, AccuracyRung from, RunTrial run,
                          Apart apart) {
  constexpr double rounding = 2e-16;  // errs as a tolerance of that size would
  auto& [coarse, fine, far] = from;
  for (;;) {
    std::optional<Track> near = run(fine);
    const double finer = std::max(fine, rounding) / coarse;  // by which the finer one errs less
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

/// The finest tolerance may be good enough by far. So a coarser one, `coarsest` at most, is looked for by which a trial
/// is off the finest one by a part of what is wanted, as was seen. `run` and `apart` as above. `factor` becomes the
/// largest that was seen. Returns nothing where the finest tolerance is not good enough by that factor: the trial that
/// told the ladder's was right by chance.
template <class RunTrial, class Apart>
std::optional<AccuracyAim> climb_up(double wanted, double coarsest, const AccuracyLadder& ladder, double& factor,
                                    RunTrial run, Apart apart) {
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

/// By `run` down to a tolerance that is good enough, and by `run_alike` up to one that is no finer than is needed.
template <class RunTrial, class RunAlike, class Apart>
AccuracyAim find_aim(double wanted, double coarsest, FinestTolerance smallest, double start, RunTrial run,
                     RunAlike run_alike, Apart apart) {
  constexpr double step = 100, coarsest_trial = 1e-3;
  AccuracyRung rung;
  rung.coarse = std::max(std::min(step * wanted, coarsest_trial), step * smallest.good);
  rung.fine = rung.coarse / step;
  rung.far = run(rung.coarse);
  for (;;) {
    AccuracyLadder ladder = climb_down(wanted, smallest, start, std::move(rung), run, apart);
    double factor = ladder.factor;
    if (std::optional<AccuracyAim> aim = climb_up(wanted, coarsest, ladder, factor, run_alike, apart)) return *aim;
    const double known = ladder.finest.tolerance, finer = std::min(aimed_at * wanted / factor, known / 10);
    rung = {known, std::max(finer, smallest.good), std::move(ladder.finest.finest)};
  }
}

}  // namespace detail
}  // namespace pendula
