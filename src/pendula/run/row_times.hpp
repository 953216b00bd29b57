#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace pendula {

/// Times at which rows are wanted, whatever the steps are, counted from the start of the run  [s].
struct RowTimes {
  double interval = 0;        ///< from row to row, the first at the start; 0: there is none
  std::vector<double> times;  ///< or these, ascending

  bool any() const { return interval > 0 || !times.empty(); }

  /// Of the row with this number, from 0 on; infinity after the last.
  double at(std::int64_t number) const {
    if (interval > 0) return static_cast<double>(number) * interval;
    const auto index = static_cast<std::size_t>(number);
    return index < times.size() ? times[index] : std::numeric_limits<double>::infinity();
  }
};

/// Whether a run that has come so far has reached a time, but for rounding, whatever the end of the run is.
inline bool is_reached(double time, double elapsed) {
  return time <= elapsed + 8 * std::numeric_limits<double>::epsilon() * elapsed;
}

}  // namespace pendula
