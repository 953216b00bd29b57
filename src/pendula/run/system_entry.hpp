#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <memory>
#include <pendula/explicit/system_forward_dynamics.hpp>
#include <pendula/lanes/lane_kernel.hpp>
#include <pendula/run/system_integrator.hpp>
#include <pendula/system/kernel_registry.hpp>
#include <pendula/system/kernel_values.hpp>

namespace pendula {

namespace detail {

template <System S>
SystemEnergies observe_system(const PlainSystem& plain, double time, const double* q, const double* v, double* points) {
  using Vector = typename S::template Vector<double>;
  const auto parameters = SystemModel<S>::read(plain, time);
  const Vector position = Eigen::Map<const Vector>(q), velocity = Eigen::Map<const Vector>(v);
  SystemEnergies energies;
  S::kinetic_energy(parameters, position, velocity, energies.kinetic);
  S::energy(parameters, position, velocity, energies.total);
  if constexpr (requires { &S::template positions<double>; }) {
    typename S::template Points<double> all;
    S::positions(parameters, position, all);
    std::copy_n(all.data(), all.size(), points);
  }
  return energies;
}

template <System S>
void system_rates(const PlainSystem& plain, double time, const double* q, const double* p, double* v) {
  using Vector = typename S::template Vector<double>;
  const Vector position = Eigen::Map<const Vector>(q), momentum = Eigen::Map<const Vector>(p);
  Vector rates;
  S::velocity_from_momentum(SystemModel<S>::read(plain, time), position, momentum, rates);
  std::copy_n(rates.data(), rates.size(), v);
}

template <System S>
bool system_is_loaded(const PlainSystem& plain) {
  return SystemModel<S>(plain).loaded();
}

template <System S>
std::unique_ptr<PlainIntegrator> make_system(const PlainSystem& plain, const RunOptions& options) {
  return make_system_integrator<S>(plain, options);
}

template <System S>
std::unique_ptr<ForwardDynamics> system_dynamics(const PlainSystem& plain) {
  return std::make_unique<SystemForwardDynamics<S>>(SystemModel<S>(plain));
}

}  // namespace detail

/// All that is compiled from the generated kernel S.
template <System S>
constexpr SystemEntry system_entry() {
  return {info_of<S>(),
          &detail::make_system<S>,
          &detail::system_dynamics<S>,
          &evaluate_kernel<S>,
          &detail::observe_system<S>,
          &detail::system_rates<S>,
          &detail::system_is_loaded<S>,
          &lane_kernel<S>};
}

}  // namespace pendula
