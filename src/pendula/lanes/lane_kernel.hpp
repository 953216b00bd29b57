#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <pendula/gauss/pace.hpp>
#include <pendula/lanes/lane_dual_functions.hpp>
#include <pendula/lanes/lane_dynamics.hpp>
#include <pendula/lanes/lane_functions.hpp>
#include <pendula/lanes/lane_inputs.hpp>
#include <pendula/lanes/lane_pack.hpp>
#include <pendula/system/mass_scale.hpp>
#include <pendula/system/system_model.hpp>

namespace pendula {

/// A generated kernel in lanes; every member has parameters, inputs and times of its own.
template <System S, class Register = MemberRegister>
class LaneKernel : public LaneDynamics {
 public:
  using L = LanePack<Register>;

  int lanes() const override { return L::size; }
  int coordinates() const override { return S::coordinates; }
  bool is_angle(int i) const override { return S::coordinate_is_angle[static_cast<std::size_t>(i)]; }
  bool of_one_unit(int i, int j) const override {
    if constexpr (requires { S::coordinate_units[0]; }) {
      return S::coordinate_units[static_cast<std::size_t>(i)] == S::coordinate_units[static_cast<std::size_t>(j)];
    } else {
      return true;  // of chains
    }
  }

  bool is_periodic(int i) const override { return S::coordinate_is_periodic[static_cast<std::size_t>(i)]; }
  bool constant_masses() const override { return S::constant_masses; }

  void take(int lane, const PlainSystem& system) override {
    if constexpr (parameter_count<S>() > 0) {
      std::array<L*, static_cast<std::size_t>(parameter_count<S>())> places;
      S::template parameter_places<L>(parameters_, places.data());
      std::array<Varied*, places.size()> varied;
      S::template parameter_places<Varied>(varied_parameters_, varied.data());
      for (std::size_t k = 0; k < places.size(); ++k) {
        places[k]->set(lane, system.parameters[k]);
        *varied[k] = Varied(*places[k]);
      }
    }
    inputs_.take(lane, system.inputs, system.sines);
  }

  void accelerations(const double* times, const double* q, const double* v, double* a) override {
    const L time = L::load(times);
    set_time(time);
    Vector<L> acceleration;
    S::acceleration(parameters_, read(q), read(v), inputs_at(time), acceleration);
    write(acceleration, a);
  }

  void variations(const double* times, const double* q, const double* v, const double* dq, const double* dv, double* a,
                  double* da) override {
    const L time = L::load(times);
    if constexpr (holds_time<S>) varied_parameters_.time = Varied(time);
    const Inputs<L> inputs = inputs_at(time);
    Inputs<Varied> varied_inputs;
    for (Eigen::Index k = 0; k < inputs.size(); ++k) varied_inputs.data()[k] = Varied(inputs.data()[k]);
    Vector<Varied> acceleration;
    S::acceleration(varied_parameters_, read(q, dq), read(v, dv), varied_inputs, acceleration);
    for (int i = 0; i < S::coordinates; ++i) {
      acceleration[i].value.store(a + i * L::size);
      acceleration[i].slope.store(da + i * L::size);
    }
  }

  void fastest_drives(double* frequencies) const override { inputs_.fastest().store(frequencies); }
  bool depends_on_time() const override { return holds_time<S>; }

  LaneStart start(const PlainSystem& system, double time, const double* q, const double* v, double* p,
                  double* pivots) const override {
    const SystemModel<S> model(system);
    const Vector<double> position = Eigen::Map<const Vector<double>>(q), rates = Eigen::Map<const Vector<double>>(v);
    Vector<double> momenta;
    S::momentum_from_velocity(model.parameters(time), position, rates, momenta);
    std::copy_n(momenta.data(), momenta.size(), p);
    Pace<S> pace;
    pace.start(model, time, position, rates);
    MassScale<S> masses;
    masses.start(model.parameters(time), position);
    for (std::size_t k = 0; k < S::coordinates; ++k) pivots[k] = masses.largest_pivot(k);
    return {pace.slowest_squared(), pace.natural_speed_squared(), model.loaded()};
  }

  void hamiltonian_form(const double* times, const double* q, const double* p, double* v, double* f) override {
    const L time = L::load(times);
    set_time(time);
    Vector<L> rates, forces;
    S::hamiltonian_form(parameters_, read(q), read(p), inputs_at(time), rates, forces);
    write(rates, v);
    write(forces, f);
  }

  void masses(const double* times, const double* q, double* masses) override {
    set_time(L::load(times));
    typename S::template Matrix<L> mass;
    S::mass_matrix(parameters_, read(q), mass);
    for (int i = 0; i < S::coordinates; ++i) {
      for (int j = 0; j < S::coordinates; ++j) mass(i, j).store(masses + (i * S::coordinates + j) * L::size);
    }
  }

  void powers(const double* times, const double* q, const double* v, double* powers) override {
    const L time = L::load(times);
    set_time(time);
    L power;
    S::power(parameters_, read(q), read(v), inputs_at(time), power);
    power.store(powers);
  }

  void energies(const double* times, const double* q, const double* v, double* kinetic, double* total) override {
    set_time(L::load(times));
    L energy;
    S::kinetic_energy(parameters_, read(q), read(v), energy);
    energy.store(kinetic);
    S::energy(parameters_, read(q), read(v), energy);
    energy.store(total);
  }

 private:
  using Varied = LaneDual<L>;
  template <class Number>
  using Vector = typename S::template Vector<Number>;
  template <class Number>
  using Inputs = typename S::template Inputs<Number>;

  static Vector<L> read(const double* numbers) {
    Vector<L> x;
    for (int i = 0; i < S::coordinates; ++i) x[i] = L::load(numbers + i * L::size);
    return x;
  }
  static void write(const Vector<L>& x, double* numbers) {
    for (int i = 0; i < S::coordinates; ++i) x[i].store(numbers + i * L::size);
  }
  static Vector<Varied> read(const double* numbers, const double* slopes) {
    Vector<Varied> x;
    for (int i = 0; i < S::coordinates; ++i) {
      x[i] = {L::load(numbers + i * L::size), L::load(slopes + i * L::size)};
    }
    return x;
  }

  void set_time(const L& time) {
    if constexpr (holds_time<S>) parameters_.time = time;
  }

  Inputs<L> inputs_at(const L& time) const {
    Inputs<L> inputs;
    inputs_.at(time, {inputs.data(), static_cast<std::size_t>(Inputs<L>::SizeAtCompileTime)});
    return inputs;
  }

  typename S::template Parameters<L> parameters_{};
  typename S::template Parameters<Varied> varied_parameters_{};  // the same
  LaneInputs<L> inputs_{static_cast<std::size_t>(Inputs<L>::SizeAtCompileTime)};
};

template <System S>
std::unique_ptr<LaneDynamics> lane_kernel() {
  return std::make_unique<LaneKernel<S>>();
}

}  // namespace pendula
