#pragma once

#include <pendula/chain.hpp>
#include <pendula/kernel_traits.hpp>
#include <pendula/state.hpp>

namespace pendula {

/// Accelerations of a chain, as explicit methods need them.
template <class Space>
class ForwardDynamics {
 public:
  virtual ~ForwardDynamics() = default;

  /// q̈ at `time`, from A(q) q̈ = B q̇² − C[q̇ q̇] − g + Q (paper eq. 27, corrected); all (dof·n).
  virtual void acceleration(double time, const Coordinates<Space, Eigen::Dynamic>& q,
                            const Coordinates<Space, Eigen::Dynamic>& v,
                            Coordinates<Space, Eigen::Dynamic>& acceleration) = 0;
};

/// Accelerations from a generated dense kernel: O(n³).
template <class Kernel>
class DenseForwardDynamics : public ForwardDynamics<SpaceOf<Kernel>> {
  using Space = SpaceOf<Kernel>;
  using Vector = typename Kernel::template Vector<double>;

 public:
  explicit DenseForwardDynamics(const Chain<Space>& chain)
      : chain_(chain), parameters_(kernel_parameters<Kernel>(chain)) {
    chain_.torque(0, torque_);
  }

  void acceleration(double time, const Coordinates<Space, Eigen::Dynamic>& q,
                    const Coordinates<Space, Eigen::Dynamic>& v,
                    Coordinates<Space, Eigen::Dynamic>& acceleration) override {
    if (chain_.driven()) chain_.torque(time, torque_);
    const Vector fixed_q = q, fixed_v = v;
    Vector fixed_acceleration;
    Kernel::acceleration(parameters_, fixed_q, fixed_v, torque_, fixed_acceleration);
    acceleration.template head<Kernel::coordinates>() = fixed_acceleration;
  }

 private:
  Chain<Space> chain_;
  typename Kernel::template Parameters<double> parameters_;
  typename Kernel::template Torque<double> torque_;
};

}  // namespace pendula
