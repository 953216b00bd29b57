#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// Accelerations of a system in one state at any number of times, of which eight are computed at once.
class AtTimes {
 public:
  explicit AtTimes(const SystemModel& model)
      : at_(model), q_(model.coordinates()), v_(model.coordinates()), found_(model.coordinates()) {}

  const SystemModel& model() const { return at_.model(); }

  /// q, v: (coordinates); found: (times, coordinates).
  void accelerations(std::span<const double> times, const double* q, const double* v, double* found) {
    const std::size_t count = model().coordinates();
    for (std::size_t k = 0; k < count; ++k) {
      std::fill_n(q_[k], width, q[k]);
      std::fill_n(v_[k], width, v[k]);
    }
    for (std::size_t first = 0; first < times.size(); first += width) {
      const std::size_t here = std::min(width, times.size() - first);
      at_.set_times([&](std::size_t lane) { return times[first + std::min(lane, here - 1)]; });
      at_(&SystemFunctions::acceleration, q_[0], v_[0], found_[0]);
      for (std::size_t lane = 0; lane < here; ++lane) {
        for (std::size_t k = 0; k < count; ++k) found[(first + lane) * count + k] = found_[k][lane];
      }
    }
  }

 private:
  static constexpr std::size_t width = 8;

  SystemAt<8> at_;
  PackRows<width> q_, v_, found_;
};

}  // namespace pendula
