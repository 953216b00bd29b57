#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/numeric/numeric.hpp>
#include <pendula/system/outcome.hpp>

/// Rules that all methods with adaptive steps share.
namespace pendula::detail {

/// Whether h is shorter than `most`, what is left, by more than a billionth of h. If not, callers end the step at
/// `most`, so that no step as short as a rounding error is left over.
template <class Num>
MaskOf<Num> ends_before(const Num& h, const Num& most) {
  return h * Num(1 + 1e-9) < most;
}

/// How often a step is tried, shorter each time, before it fails; less often in lanes, where all members wait for it.
inline constexpr int most_attempts = 100, most_attempts_in_lanes = 40;

/// A step fails where it would be smaller than this fraction of the time so far.
inline constexpr double smallest_step = 1e-13;

/// Tries steps, at most `most` long, shorter each time, until one is good enough.
template <class Method>
Outcome find_step(Method& method, double most, int tries) {
  for (int attempt = 1;; ++attempt) {
    const double h = std::min(method.wanted(), most);
    const Outcome found = method.try_step(h, attempt == 1);
    const bool is_last = attempt == tries || found.status == Status::interrupted;
    if (found || is_last || h < smallest_step * std::abs(method.time())) return found;
  }
}

/// One step of one motion, of the method's own choice, at most `most` long. Where a step that is cut short fails, the
/// next one is looked for as if nothing cut it: so a run that is interrupted and goes on takes the steps of one that
/// was not. A method has
///   double time();  double wanted(): the size of the next try
///   void keep();  void restore(): what trying a step changes
///   Outcome try_step(double h, bool is_first): ok if the step is good enough; if not, the next wanted() is shorter
///   Outcome take(const Outcome& found, bool is_cut): goes where the step that was found ends
template <class Method>
Outcome take_chosen_step(Method& method, double most) {
  if (ends_before(method.wanted(), most)) {
    const Outcome found = find_step(method, most, most_attempts);
    return found ? method.take(found, false) : found;
  }
  method.keep();
  Outcome found = find_step(method, most, 1);
  bool is_cut = true;
  if (!found && found.status != Status::interrupted) {
    method.restore();
    found = find_step(method, std::numeric_limits<double>::infinity(), most_attempts);
    is_cut = !found || !ends_before(found.step, most);
    if (is_cut) {
      method.restore();
      found = find_step(method, most, most_attempts);
      is_cut = found && !ends_before(found.step, most);
    }
  }
  return found ? method.take(found, is_cut) : found;
}

}  // namespace pendula::detail
