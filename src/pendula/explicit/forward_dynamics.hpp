#pragma once

#include <cstddef>
#include <span>

namespace pendula {

/// Accelerations for explicit methods. The interface does not use Eigen, because it crosses between a program and the
/// compiled library (library.hpp).
class ForwardDynamics {
 public:
  ForwardDynamics() = default;
  ForwardDynamics(const ForwardDynamics&) = delete;
  ForwardDynamics& operator=(const ForwardDynamics&) = delete;
  virtual ~ForwardDynamics() = default;

  /// q̈ at `time`, from A(q) q̈ = B q̇² − C[q̇ q̇] − g + Q (paper eq. 27, corrected); all (dof·n).
  virtual void acceleration(double time, const double* q, const double* v, double* acceleration) = 0;

  /// Highest driving frequency  [rad/s].
  virtual double fastest_drive() const { return 0; }
  /// Whether accelerations depend on time in other ways.
  virtual bool depends_on_time() const { return false; }
  /// If so: accelerations of one state at each of `count` times, (count, dof·n).
  virtual void accelerations(const double* /*times*/, std::size_t /*count*/, const double* /*q*/, const double* /*v*/,
                             double* /*found*/) {}

  /// For each argument of the model's functions that may change fast: whether it is the base of a power
  /// (field_look.hpp).
  virtual std::span<const bool> arguments() const { return {}; }
  /// Values of these arguments in eight states at once, each in a lane of rows (PackRows<8>): q and v (dof·n, 8),
  /// `found` (arguments, 8).
  virtual void find_arguments(const double* /*times*/, const double* /*q*/, const double* /*v*/, double* /*found*/) {}
};

}  // namespace pendula
