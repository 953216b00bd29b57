#pragma once

#include <Eigen/Core>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/kernel_traits.hpp>
#include <pendula/explicit/forward_dynamics.hpp>

namespace pendula {

/// Accelerations from a generated dense kernel: O(n³).
template <class Kernel>
class DenseForwardDynamics : public ForwardDynamics {
  using Vector = typename Kernel::template Vector<double>;

 public:
  explicit DenseForwardDynamics(const Chain<SpaceOf<Kernel>>& chain)
      : chain_(chain), parameters_(kernel_parameters<Kernel>(chain)) {
    chain_.torque(0, torque_);
  }

  void acceleration(double time, const double* q, const double* v, double* acceleration) override {
    if (chain_.driven()) chain_.torque(time, torque_);
    const Vector fixed_q = Eigen::Map<const Vector>(q), fixed_v = Eigen::Map<const Vector>(v);
    Vector fixed_acceleration;
    Kernel::acceleration(parameters_, fixed_q, fixed_v, torque_, fixed_acceleration);
    Eigen::Map<Vector> result(acceleration);
    result = fixed_acceleration;
  }

 private:
  Chain<SpaceOf<Kernel>> chain_;
  typename Kernel::template Parameters<double> parameters_;
  typename Kernel::template Torque<double> torque_;
};

}  // namespace pendula
