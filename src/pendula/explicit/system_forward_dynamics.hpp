#pragma once

#include <cstddef>
#include <pendula/explicit/forward_dynamics.hpp>
#include <pendula/system/at_times.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// Accelerations from a generated kernel, in O(n³).
class SystemForwardDynamics : public ForwardDynamics {
 public:
  explicit SystemForwardDynamics(const SystemModel& model) : here_(model), eight_(model), at_times_(model) {}

  void acceleration(double time, const double* q, const double* v, double* acceleration) override {
    here_.set_time(time);
    here_(&SystemFunctions::acceleration, q, v, acceleration);
  }

  double fastest_drive() const override { return here_.model().fastest_drive(); }
  bool depends_on_time() const override { return here_.model().info().depends_on_time; }
  void accelerations(const double* times, std::size_t count, const double* q, const double* v, double* found) override {
    at_times_.accelerations({times, count}, q, v, found);
  }

  std::span<const bool> arguments() const override { return here_.model().info().argument_is_base; }
  void find_arguments(const double* times, const double* q, const double* v, double* found) override {
    eight_.set_times([&](std::size_t lane) { return times[lane]; });
    eight_(&SystemFunctions::call_arguments, q, v, found);
  }

 private:
  SystemAt<1> here_;
  SystemAt<8> eight_;
  AtTimes at_times_;
};

}  // namespace pendula
