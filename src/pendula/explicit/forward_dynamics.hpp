#pragma once

namespace pendula {

/// Accelerations of a chain, as explicit methods need them. Nothing of Eigen, because it crosses between a program and
/// the compiled library (library.hpp).
class ForwardDynamics {
 public:
  ForwardDynamics() = default;
  ForwardDynamics(const ForwardDynamics&) = delete;
  ForwardDynamics& operator=(const ForwardDynamics&) = delete;
  virtual ~ForwardDynamics() = default;

  /// q̈ at `time`, from A(q) q̈ = B q̇² − C[q̇ q̇] − g + Q (paper eq. 27, corrected); all (dof·n).
  virtual void acceleration(double time, const double* q, const double* v, double* acceleration) = 0;
};

}  // namespace pendula
