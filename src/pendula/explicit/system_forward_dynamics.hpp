#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <pendula/explicit/forward_dynamics.hpp>
#include <pendula/numeric/functions.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/system/accelerations_in_time.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// Accelerations from a generated kernel: O(n³).
template <System S>
class SystemForwardDynamics : public ForwardDynamics {
  using Vector = typename S::template Vector<double>;

 public:
  explicit SystemForwardDynamics(const SystemModel<S>& model) : model_(model) {}

  void acceleration(double time, const double* q, const double* v, double* acceleration) override {
    const Vector fixed_q = Eigen::Map<const Vector>(q), fixed_v = Eigen::Map<const Vector>(v);
    Vector fixed_acceleration;
    S::acceleration(model_.parameters(time), fixed_q, fixed_v, model_.inputs(time), fixed_acceleration);
    Eigen::Map<Vector> result(acceleration);
    result = fixed_acceleration;
  }

  double fastest_drive() const override { return model_.fastest_drive(); }
  bool depends_on_time() const override { return holds_time<S>; }
  void accelerations(const double* times, std::size_t count, const double* q, const double* v, double* found) override {
    if constexpr (holds_time<S>) {
      accelerations_in_time(model_, std::span(times, count), Eigen::Map<const Vector>(q), Eigen::Map<const Vector>(v),
                            found);
    }
  }

  std::span<const bool> arguments() const override { return argument_bases<S>(); }
  void find_arguments(const double* times, std::size_t count, const double* q, const double* v,
                      double* found) override {
    if constexpr (tells_arguments<S>) {
      for (std::size_t first = 0; first < count; first += width) {
        const std::size_t here = std::min(width, count - first);
        find_some(times + first, here, q + first * coordinates, v + first * coordinates,
                  found + first * S::argument_is_base.size());
      }
    }
  }

 private:
  static constexpr std::size_t width = 8, coordinates = S::coordinates;
  using L = Pack<width, RegisterFor<width>>;

  // In lanes; those beyond repeat the last.
  void find_some(const double* times, std::size_t count, const double* q, const double* v, double* found) const {
    alignas(pack_alignment) double numbers[width];
    const auto load = [&](auto&& number) {
      for (std::size_t lane = 0; lane < width; ++lane) numbers[lane] = number(std::min(lane, count - 1));
      return L::load(numbers);
    };
    typename S::template Parameters<L> parameters;
    S::cast_parameters(model_.parameters(0), parameters);
    if constexpr (holds_time<S>) parameters.time = load([&](std::size_t lane) { return times[lane]; });
    typename S::template Vector<L> Q, V;
    for (std::size_t k = 0; k < coordinates; ++k) {
      Q[static_cast<Eigen::Index>(k)] = load([&](std::size_t lane) { return q[lane * coordinates + k]; });
      V[static_cast<Eigen::Index>(k)] = load([&](std::size_t lane) { return v[lane * coordinates + k]; });
    }
    typename S::template Inputs<L> inputs;
    for (Eigen::Index i = 0; i < inputs.size(); ++i) {
      inputs.data()[i] = load([&](std::size_t lane) { return model_.inputs(times[lane]).data()[i]; });
    }
    typename S::template Arguments<L> arguments;
    S::call_arguments(parameters, Q, V, inputs, arguments);
    for (Eigen::Index a = 0; a < arguments.size(); ++a) {
      arguments[a].store(numbers);
      for (std::size_t lane = 0; lane < count; ++lane) {
        found[lane * S::argument_is_base.size() + static_cast<std::size_t>(a)] = numbers[lane];
      }
    }
  }

  SystemModel<S> model_;
};

}  // namespace pendula
