#pragma once

#include <cstddef>
#include <pendula/explicit/forward_dynamics.hpp>
#include <pendula/system/many_states.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// Accelerations from a generated kernel, in O(n³).
class SystemForwardDynamics : public ForwardDynamics {
 public:
  explicit SystemForwardDynamics(const SystemModel& model) : here_(model), many_(model) {}

  void acceleration(double time, const double* q, const double* v, double* acceleration) override {
    here_.set_time(time);
    here_(&SystemFunctions::acceleration, q, v, acceleration);
  }

  double fastest_drive() const override { return many_.model().fastest_drive(); }
  bool depends_on_time() const override { return many_.model().info().depends_on_time; }
  void accelerations(const double* times, std::size_t count, const double* q, const double* v, double* found) override {
    many_.accelerations({times, count}, q, v, found);
  }

  std::span<const bool> arguments() const override { return many_.model().info().argument_is_base; }
  void find_arguments(const double* times, std::size_t count, const double* q, const double* v,
                      double* found) override {
    many_.arguments({times, count}, q, v, found);
  }

 private:
  SystemAt<1> here_;
  ManyStates many_;
};

}  // namespace pendula
