#pragma once

#include <pendula/system/system_model.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula {

/// Calls the functions of a system, at one state and at the stages of a step.
template <int Width>
class StageDynamics {
 public:
  explicit StageDynamics(const SystemModel& model) : at_stages_(model), here_(model) {}

  const SystemModel& model() const { return at_stages_.model(); }
  const SystemInfo& info() const { return model().info(); }

  const SystemAt<1>& at(double time) const {
    here_.set_time(time);
    return here_;
  }
  template <class Function, class... Numbers>
  void here(double time, Function function, Numbers... numbers) const {
    at(time)(function, numbers...);
  }

  const SystemAt<Width>& stages() const { return at_stages_; }
  template <class Times>
  void set_times(Times times) {
    at_stages_.set_times(times);
  }
  template <class Function, class... Numbers>
  void call(const double* /*times*/, Function function, Numbers... numbers) const {
    at_stages_(function, numbers...);
  }

 private:
  SystemAt<Width> at_stages_;
  mutable SystemAt<1> here_;
};

}  // namespace pendula
