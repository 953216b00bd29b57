#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/numeric/directions.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/system_model.hpp>
#include <utility>

namespace pendula {

/// Exact derivatives of a system's functions by coordinates, then rates, at one state: by its kernel in dual numbers,
/// several directions at once.
class StateSlopes {
 public:
  explicit StateSlopes(const SystemModel& model)
      : n_(model.coordinates()),
        constraints_(model.info().constraints.size()),
        at_(model),
        still_(model.parameters().size() + 1),
        moved_(2 * n_),
        states_(2 * n_),
        found_(2 * std::max(n_, constraints_)) {}

  /// Of accelerations that constraints do not change  (coordinates x 2 coordinates).
  Directions<> acceleration(double time, const double* q, const double* v) {
    go_to(time, q, v);
    return along(n_, n_,
                 [&](const double* dq, const double* dv) {
                   at_(&SystemFunctions::acceleration_along, states_[0], states_[n_], dq, dv, found_[0], found_[n_]);
                 })
        .second;
  }

  /// Of dg/dt, and of d²g/dt² where nothing accelerates  (constraints x 2 coordinates).
  std::pair<Directions<>, Directions<>> constraint_rates(double time, const double* q, const double* v) {
    go_to(time, q, v);
    return along(constraints_, constraints_, [&](const double* dq, const double* dv) {
      at_(&SystemFunctions::constraint_rates_along, still_[0], dq, dv, states_[0], states_[n_], found_[0],
          found_[constraints_]);
    });
  }

 private:
  static constexpr std::size_t width = 8;

  void go_to(double time, const double* q, const double* v) {
    at_.set_time(time);
    for (std::size_t k = 0; k < n_; ++k) {
      std::fill_n(states_[k], width, q[k]);
      std::fill_n(states_[n_ + k], width, v[k]);
    }
  }

  // What run(dq, dv) writes to the first `first` rows that it finds, and to `second` ones after them.
  template <class Run>
  std::pair<Directions<>, Directions<>> along(std::size_t first, std::size_t second, Run run) {
    const auto rows = [&](std::size_t count) {
      return Directions<>(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(2 * n_));
    };
    std::pair<Directions<>, Directions<>> all(rows(first), rows(second));
    for (std::size_t begin = 0; begin < 2 * n_; begin += width) {
      const std::size_t count = std::min(width, 2 * n_ - begin);
      std::fill_n(moved_[0], 2 * n_ * width, 0.0);
      for (std::size_t lane = 0; lane < count; ++lane) moved_[begin + lane][lane] = 1;
      run(moved_[0], moved_[n_]);
      for (std::size_t row = 0; row < first + second; ++row) {
        for (std::size_t lane = 0; lane < count; ++lane) {
          const auto column = static_cast<Eigen::Index>(begin + lane);
          (row < first ? all.first(static_cast<Eigen::Index>(row), column)
                       : all.second(static_cast<Eigen::Index>(row - first), column)) = found_[row][lane];
        }
      }
    }
    return all;
  }

  std::size_t n_, constraints_;
  SystemAt<width> at_;
  PackRows<width> still_, moved_, states_, found_;
};

}  // namespace pendula
