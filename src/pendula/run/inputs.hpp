#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <limits>
#include <memory>
#include <pendula/run/subject.hpp>
#include <span>
#include <string>
#include <vector>

namespace pendula {

/// Names of a subject's inputs; of a chain its torques, link by link: "torque_1", in space "torque_x_1".
std::vector<std::string> input_names(const Subject& subject);

/// The constant parts of a subject's inputs.
std::vector<double> inputs_of(const Subject& subject);

/// A line that is added to an input for a time: slope (t - since).
struct InputLine {
  std::size_t input = 0;
  double slope = 0;
  double since = 0;     ///< [s]
  double duration = 0;  ///< > 0  [s]
};

/// The same subject with `inputs` as the constant parts, and with `lines` added; drives stay. Throws
/// std::invalid_argument on another number of inputs than the subject has, and on one that is not finite.
std::shared_ptr<const Subject> with_inputs(const std::shared_ptr<const Subject>& subject,
                                           std::span<const double> inputs, std::span<const InputLine> lines = {});

/// A table of numbers over time that is added to an input: linear from knot to knot, or held from each knot to the
/// next, and constant before the first knot and from the last one on.
struct Signal {
  std::size_t input = 0;      ///< index among the subject's inputs (inputs.hpp)
  std::vector<double> times;  ///< of the knots, ascending, one at least  [s]
  std::vector<double> values;
  bool is_held = false;

  /// Times that differ by no more, relatively, are the same: the third sample of 0.1 s is at a knot at 0.3 s.
  static constexpr double rounding = 1e-12;

  /// The last knot at or before a time; −1 if there is none.
  std::ptrdiff_t knot_before(double time) const {
    const double most = time + rounding * (time < 0 ? -time : time);
    return std::ranges::upper_bound(times, most) - times.begin() - 1;
  }

  /// The first knot after a time; infinite if there is none.
  double next_knot(double time) const {
    const auto next = static_cast<std::size_t>(knot_before(time) + 1);
    return next < times.size() ? times[next] : std::numeric_limits<double>::infinity();
  }

  double at(double time) const {
    const std::ptrdiff_t knot = knot_before(time);
    if (knot < 0) return values.front();
    const auto k = static_cast<std::size_t>(knot);
    return values[k] + slope_after(knot) * (time - times[k]);
  }

  /// The slope from a knot to the next; 0 before the first knot and after the last.
  double slope_after(std::ptrdiff_t knot) const {
    if (is_held || knot < 0 || knot + 1 >= std::ssize(times)) return 0;
    const auto k = static_cast<std::size_t>(knot);
    return (values[k + 1] - values[k]) / (times[k + 1] - times[k]);
  }
};

}  // namespace pendula
