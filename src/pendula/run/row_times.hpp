#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace pendula {

/// Times of rows, independent of the steps, counted from the start of the run  [s].
struct RowTimes {
  double interval = 0;        ///< between rows, the first at the start; 0: none
  std::vector<double> times;  ///< instead of an interval, ascending
  /// Whether the program chose the times. Then the last state is a row, too, and a resumed run keeps the times that it
  /// began with.
  bool chosen = false;

  bool any() const { return interval > 0 || !times.empty(); }

  /// Time of row `number`, counted from 0; infinity after the last.
  double at(std::int64_t number) const {
    if (interval > 0) return static_cast<double>(number) * interval;
    const auto index = static_cast<std::size_t>(number);
    return index < times.size() ? times[index] : std::numeric_limits<double>::infinity();
  }
};

/// Whether `elapsed` has reached `time`, up to rounding.
inline bool is_reached(double time, double elapsed) {
  return time <= elapsed + 8 * std::numeric_limits<double>::epsilon() * elapsed;
}

}  // namespace pendula
