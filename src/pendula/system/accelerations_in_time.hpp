#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/numeric/functions.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// q̈ of one state q, v at each of some times, (times, coordinates): several times at once, in lanes.
template <System S>
void accelerations_in_time(const SystemModel<S>& model, std::span<const double> times,
                           const typename S::template Vector<double>& q, const typename S::template Vector<double>& v,
                           double* found) {
  constexpr std::size_t width = 8, count = S::coordinates;
  using L = Pack<width, RegisterFor<width>>;
  typename S::template Parameters<L> parameters;
  S::cast_parameters(model.parameters(0), parameters);
  typename S::template Vector<L> place, rate, acceleration;
  for (std::size_t k = 0; k < count; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    place[i] = L(q[i]);
    rate[i] = L(v[i]);
  }
  typename S::template Inputs<L> inputs;
  for (std::size_t first = 0; first < times.size(); first += width) {
    const std::size_t here = std::min(width, times.size() - first);
    alignas(pack_alignment) double numbers[width];
    for (std::size_t lane = 0; lane < width; ++lane) numbers[lane] = times[first + std::min(lane, here - 1)];
    if constexpr (holds_time<S>) parameters.time = L::load(numbers);
    for (Eigen::Index i = 0; i < inputs.size(); ++i) {
      for (std::size_t lane = 0; lane < width; ++lane) {
        numbers[lane] = model.inputs(times[first + std::min(lane, here - 1)]).data()[i];
      }
      inputs.data()[i] = L::load(numbers);
    }
    S::acceleration(parameters, place, rate, inputs, acceleration);
    for (std::size_t k = 0; k < count; ++k) {
      acceleration[static_cast<Eigen::Index>(k)].store(numbers);
      for (std::size_t lane = 0; lane < here; ++lane) found[(first + lane) * count + k] = numbers[lane];
    }
  }
}

}  // namespace pendula
