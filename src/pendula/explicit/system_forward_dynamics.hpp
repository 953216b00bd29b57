#pragma once

#include <cstddef>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// Accelerations of a generated kernel for explicit methods, in O(n³).
class SystemForwardDynamics {
 public:
  explicit SystemForwardDynamics(const SystemModel& model) : here_(model), eight_(model), at_times_(model) {}

  /// q̈ at `time`; all (coordinates).
  void acceleration(double time, const double* q, const double* v, double* acceleration) {
    here_.set_time(time);
    here_(&SystemFunctions::acceleration, q, v, acceleration);
  }

  /// Highest driving frequency  [rad/s].
  double fastest_drive() const { return here_.model().fastest_drive(); }
  /// Whether accelerations depend on time other than through drives.
  bool depends_on_time() const { return here_.model().info().depends_on_time; }
  /// Accelerations of one state at each of `count` times, (count, coordinates).
  void accelerations(const double* times, std::size_t count, const double* q, const double* v, double* found) {
    at_times_.accelerations({times, count}, q, v, found);
  }

  /// For each argument of the model's functions that may change fast: whether it is the base of a power
  /// (field_look.hpp).
  std::span<const bool> arguments() const { return here_.model().info().argument_is_base; }
  /// Values of these arguments in eight states at once, each in a lane of rows (PackRows<8>): q and v
  /// (coordinates, 8), `found` (arguments, 8).
  void find_arguments(const double* times, const double* q, const double* v, double* found) {
    eight_.set_times([&](std::size_t lane) { return times[lane]; });
    eight_(&SystemFunctions::call_arguments, q, v, found);
  }

 private:
  SystemAt<1> here_;
  SystemAt<8> eight_;
  AtTimes at_times_;
};

}  // namespace pendula
