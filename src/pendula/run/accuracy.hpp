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

/// The smallest tolerance that steps are chosen by: one that rounding allows, and where the order is given, one that
/// takes no more than some steps for each of a run by the accuracy itself.
inline double finest_tolerance(const RunOptions& options, const Accuracy& accuracy) {
  constexpr double most_steps = 4;
  const double rounding = is_explicit(options.method) ? 1e-14 : 1e-16;
  if (accuracy.chooses_stages || options.method == Method::bulirsch_stoer) return rounding;
  return std::max(rounding, accuracy.error * std::pow(most_steps, -order_of(options)));
}

/// Motion makes of the errors of its steps what it does: a factor that grows with chaos, and is nearly the same for all
/// tolerances under which runs end close to each other. So two trials tell it, by tolerances 100 apart: they end apart
/// by the error of the first. Where that is too far for a factor, the next two are finer, and then the finest that
/// there are. `end(tolerance)` is the last state by that tolerance, nothing where a run does not come there; `distance`
/// that of two states. Constants: measured on random chains, docs/time.md.
template <class End, class Distance>
AccuracyAim aim_at(double wanted, double finest, End end, Distance distance) {
  constexpr double apart = 100, coarsest = 1e-3, together = 0.01, margin = 0.3;
  constexpr double rounding = 2e-16;  // errs as a tolerance of that size would
  const double first = std::max(std::min(apart * apart * wanted, coarsest), apart * finest);
  double last = 0;
  std::optional<Motion> near;
  for (const double coarse : {first, first / apart, apart * finest}) {
    if (coarse < apart * finest || coarse / apart == last) continue;
    const std::optional<Motion> far = coarse == last ? std::move(near) : end(coarse);
    last = coarse / apart;
    near = end(last);
    const double off = far && near ? distance(*far, *near) : std::numeric_limits<double>::infinity();
    if (!(off <= together)) continue;
    const double factor = off / coarse;
    // Not larger than what is wanted, however much of its errors the motion forgets: there are rows on its way.
    const double tolerance = factor > 1 ? std::max(margin * wanted / factor, finest) : wanted;
    return {tolerance, factor * std::max(tolerance, rounding)};
  }
  return {wanted};
}

}  // namespace detail
}  // namespace pendula
