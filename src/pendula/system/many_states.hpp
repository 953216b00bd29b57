#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// Evaluates functions of a system in any number of states, eight at a time.
class ManyStates {
 public:
  explicit ManyStates(const SystemModel& model)
      : at_(model),
        q_(model.coordinates()),
        v_(model.coordinates()),
        found_(std::max(model.coordinates(), model.info().argument_is_base.size())) {}

  const SystemModel& model() const { return at_.model(); }

  /// Accelerations of one state q, v at each of the times: (times, coordinates).
  void accelerations(std::span<const double> times, const double* q, const double* v, double* found) {
    evaluate(&SystemFunctions::acceleration, model().coordinates(), times, q, v, 0, found);
  }

  /// Arguments of the model's functions in states q, v, (times, coordinates): (times, arguments).
  void arguments(std::span<const double> times, const double* q, const double* v, double* found) {
    evaluate(&SystemFunctions::call_arguments, model().info().argument_is_base.size(), times, q, v,
             model().coordinates(), found);
  }

 private:
  static constexpr std::size_t width = 8;
  using Function = void (*)(const Conditions&, const double* q, const double* v, double* found);

  // States are `apart` numbers apart, results `count` numbers. Lanes beyond the last state repeat it.
  void evaluate(Function SystemFunctions::*function, std::size_t count, std::span<const double> times, const double* q,
                const double* v, std::size_t apart, double* found) {
    for (std::size_t first = 0; first < times.size(); first += width) {
      const auto state = [&](std::size_t lane) { return std::min(first + lane, times.size() - 1); };
      at_.set_times([&](std::size_t lane) { return times[state(lane)]; });
      for (std::size_t k = 0; k < model().coordinates(); ++k) {
        for (std::size_t lane = 0; lane < width; ++lane) {
          q_[k][lane] = q[state(lane) * apart + k];
          v_[k][lane] = v[state(lane) * apart + k];
        }
      }
      at_(function, q_[0], v_[0], found_[0]);
      for (std::size_t lane = 0; lane < std::min(width, times.size() - first); ++lane) {
        for (std::size_t k = 0; k < count; ++k) found[(first + lane) * count + k] = found_[k][lane];
      }
    }
  }

  SystemAt<8> at_;
  PackRows<width> q_, v_, found_;
};

}  // namespace pendula
