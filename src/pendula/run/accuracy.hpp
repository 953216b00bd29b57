#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <utility>

namespace pendula {

/// What is wanted of the last state of a run.
struct Accuracy {
  double error = 0;            ///< relative to the size and the speed of the motion; 0: what the tolerance makes of it
  bool chooses_stages = true;  ///< as many as the tolerance wants; else those of the options
};

/// By which tolerance a run ends as accurately as is wanted.
struct AccuracyAim {
  double tolerance = 0;
  /// Error at the end by that tolerance; infinite where trials by the smallest ones do not end together.
  double error = std::numeric_limits<double>::infinity();
  Motion near;  ///< where the last trial ended, which went by that tolerance too, from all but the same start

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(tolerance, error, near.time, near.q, near.v);
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

/// The smallest tolerance that steps are chosen by: one that rounding allows, and where the order is given, one that
/// takes no more than some steps for each of a run by the accuracy itself.
inline double finest_tolerance(const RunOptions& options, const Accuracy& accuracy) {
  constexpr double most_steps = 4;
  const double rounding = is_explicit(options.method) ? 1e-14 : 1e-16;
  const bool chooses_order = options.method == Method::bulirsch_stoer || options.method == Method::taylor;
  if (accuracy.chooses_stages || chooses_order) return rounding;
  return std::max(rounding, accuracy.error * std::pow(most_steps, -order_of(options)));
}

/// What is known of the errors by two tolerances of which the finer one is good enough.
struct AccuracyLadder {
  AccuracyAim finest;  ///< `near` of which all others are compared with
  double factor = 0;   ///< what the motion makes of a tolerance
};

/// What a motion makes of the errors of its steps is a factor that grows with chaos. Trials tell it: `end(tolerance)`
/// is the last state by that, nothing where a run does not come there. Two of them end apart by the error of the
/// coarser one; `distance` is that of two states. Where the finer one is not expected to be good enough, or they end
/// too far apart for a factor, the next is finer, and is compared with it. Errors scatter about what tolerances ask for
/// by factors of ten and more, so that aims lie below what is wanted.
template <class End, class Distance>
AccuracyLadder climb_down(double wanted, double finest, End end, Distance distance) {
  constexpr double apart = 100, coarsest = 1e-3, together = 0.01, enough = 0.3, aimed = 0.1;
  constexpr double rounding = 2e-16;  // errs as a tolerance of that size would
  double coarse = std::max(std::min(apart * wanted, coarsest), apart * finest), fine = coarse / apart;
  std::optional<Motion> far = end(coarse);
  for (;;) {
    std::optional<Motion> near = end(fine);
    const double off = far && near ? distance(*far, *near) : std::numeric_limits<double>::infinity();
    double next = fine / (10 * apart);
    if (off <= together) {
      const double factor = off / coarse, error = factor * std::max(fine, rounding);
      if (error <= enough * wanted || fine <= finest) return {{fine, error, *std::move(near)}, factor};
      next = std::min(aimed * wanted / factor, fine / 10);
    } else if (fine <= finest) {
      return {{wanted, std::numeric_limits<double>::infinity(), {}}};
    }
    coarse = fine;
    fine = std::max(next, finest);
    far = std::move(near);
  }
}

/// The finest tolerance may be good enough by far. So a coarser one is looked for by which the run itself ends off the
/// finest trial by a part of what is wanted, as was seen: `end(tolerance)` is the last state of that run.
template <class End, class Distance>
AccuracyAim climb_up(double wanted, const AccuracyLadder& ladder, End end, Distance distance) {
  constexpr double least = 0.05, most = 1, aimed = 0.2, coarsest = 1, apart = 5, most_change = 100;
  constexpr int most_trials = 6;
  AccuracyAim best = ladder.finest;
  double tolerance = ladder.factor > 0 ? aimed * wanted / ladder.factor : coarsest;
  double low = apart * best.tolerance, high = coarsest, before = 0;
  if (!(best.error <= wanted)) return best;
  for (int trial = 0; trial < most_trials && 2 * low < high; ++trial) {
    tolerance = std::clamp(tolerance, low, high);
    const std::optional<Motion> there = end(tolerance);
    const double error = there ? distance(*there, best.near) : std::numeric_limits<double>::infinity();
    if (error <= most * wanted) best = {tolerance, error, std::move(best.near)};
    if (error >= least * wanted && error <= most * wanted) break;
    (error > most * wanted ? high : low) = tolerance;
    const bool is_finest_trials = error < least * wanted && error < 1.5 * std::exchange(before, error);
    tolerance *= is_finest_trials ? most_change : std::clamp(aimed * wanted / error, 1 / most_change, most_change);
    if (tolerance <= low || tolerance >= high) tolerance = std::sqrt(low * high);
  }
  return best;
}

}  // namespace detail
}  // namespace pendula
