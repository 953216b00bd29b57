#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// A system with its numbers: immutable.
template <System S>
class SystemModel {
 public:
  using Parameters = typename S::template Parameters<double>;
  using Inputs = typename S::template Inputs<double>;
  using Vector = typename S::template Vector<double>;

  /// `inputs` are constant; `sines` are added to them. In `parameters` time may be anything.
  explicit SystemModel(const Parameters& parameters, const Inputs& inputs = none(), std::vector<InputSine> sines = {})
      : parameters_(parameters), constant_(inputs), sines_(std::move(sines)) {
    sample_power();
  }

  /// The same from plain numbers.
  explicit SystemModel(const PlainSystem& plain)
      : SystemModel(read(plain), read_inputs(plain), {plain.sines.begin(), plain.sines.end()}) {}

  /// Parameters out of plain numbers, at `time`.
  static Parameters read(const PlainSystem& plain, double time = 0) {
    Parameters parameters{};
    S::template read_parameters<double>(plain.parameters, parameters);
    if constexpr (holds_time<S>) parameters.time = time;
    return parameters;
  }

  /// Inputs of a system that nobody drives.
  static Inputs none() {
    Inputs inputs;
    std::fill_n(inputs.data(), inputs.size(), 0.0);
    return inputs;
  }

  /// The parameters, at `time` where the system holds it.
  Parameters parameters(double time) const {
    Parameters parameters = parameters_;
    if constexpr (holds_time<S>) parameters.time = time;
    return parameters;
  }

  Inputs inputs(double time) const {
    Inputs inputs = constant_;
    for (const InputSine& sine : sines_) {
      inputs.data()[sine.input] += sine.amplitude * std::sin(sine.frequency * time + sine.phase);
    }
    return inputs;
  }

  /// Whether anything depends on time.
  bool driven() const { return holds_time<S> || !sines_.empty(); }

  /// Highest frequency of a sine that is added to an input; 0 where there is none  [rad/s].
  double fastest_drive() const {
    double fastest = 0;
    for (const InputSine& sine : sines_) {
      if (sine.amplitude != 0) fastest = std::max(fastest, std::abs(sine.frequency));
    }
    return fastest;
  }

  /// Whether energy may come from outside, or go there.
  bool loaded() const { return loaded_; }

  /// Whether forces without inputs take energy out.
  bool damped() const { return damped_; }

 private:
  static Inputs read_inputs(const PlainSystem& plain) {
    Inputs inputs;
    std::copy_n(plain.inputs, inputs.size(), inputs.data());
    return inputs;
  }

  // Forces are loads where they bring power somewhere: looked for in a few states, none of which is special. What
  // depends on time may bring it at others.
  void sample_power() {
    for (int k = 1; k <= samples; ++k) {
      Vector q, v;
      for (Eigen::Index i = 0; i < q.size(); ++i) {
        q[i] = 0.5 + std::sin(1.7 * k + 2.3 * static_cast<double>(i));
        v[i] = std::cos(1.1 * k + 3.1 * static_cast<double>(i));
      }
      double power = 0, own = 0;
      S::power(parameters(0.37 * k), q, v, inputs(0.37 * k), power);
      S::power(parameters(0.37 * k), q, v, none(), own);
      loaded_ = loaded_ || power != 0;
      damped_ = damped_ || own < 0;
    }
  }

  static constexpr int samples = 4;

  Parameters parameters_;
  Inputs constant_;
  std::vector<InputSine> sines_;
  bool loaded_ = holds_time<S>, damped_ = false;
};

/// Coordinates and rates of a system at one time.
template <System S>
struct SystemState {
  using Vector = typename S::template Vector<double>;

  double time = 0;  ///< s
  Vector q, v;

  SystemState() = default;
  SystemState(double at, const Vector& position, const Vector& velocity) : time(at), q(position), v(velocity) {}
  /// Of whatever has a time, coordinates and rates: the state of a chain, say.
  template <class Other>
  requires requires(const Other& other) { Vector(other.q), Vector(other.v), other.time; }
  SystemState(const Other& other) : time(other.time), q(other.q), v(other.v) {}  // NOLINT(google-explicit-constructor)
};

}  // namespace pendula
