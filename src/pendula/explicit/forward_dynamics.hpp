#pragma once

#include <cstddef>
#include <span>

namespace pendula {

/// Accelerations, as explicit methods need them. Nothing of Eigen, because it crosses between a program and
/// the compiled library (library.hpp).
class ForwardDynamics {
 public:
  ForwardDynamics() = default;
  ForwardDynamics(const ForwardDynamics&) = delete;
  ForwardDynamics& operator=(const ForwardDynamics&) = delete;
  virtual ~ForwardDynamics() = default;

  /// q̈ at `time`, from A(q) q̈ = B q̇² − C[q̇ q̇] − g + Q (paper eq. 27, corrected); all (dof·n).
  virtual void acceleration(double time, const double* q, const double* v, double* acceleration) = 0;

  /// Highest frequency of what drives it  [rad/s].
  virtual double fastest_drive() const { return 0; }
  /// Whether it depends on time in other ways.
  virtual bool depends_on_time() const { return false; }
  /// Then, of one state at each of `count` times, (count, dof·n).
  virtual void accelerations(const double* /*times*/, std::size_t /*count*/, const double* /*q*/, const double* /*v*/,
                             double* /*found*/) {}

  /// Of what its functions are taken of that may be narrow, whether it is the base of a power (field_look.hpp).
  virtual std::span<const bool> arguments() const { return {}; }
  /// And what that is in each of `count` states, (count, dof·n): (count, arguments).
  virtual void find_arguments(const double* /*times*/, std::size_t /*count*/, const double* /*q*/, const double* /*v*/,
                              double* /*found*/) {}
};

}  // namespace pendula
