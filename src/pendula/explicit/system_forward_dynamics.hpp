#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <pendula/explicit/forward_dynamics.hpp>
#include <pendula/system/accelerations_in_time.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// Accelerations from a generated kernel: O(n³).
template <System S>
class SystemForwardDynamics : public ForwardDynamics {
  using Vector = typename S::template Vector<double>;

 public:
  explicit SystemForwardDynamics(const SystemModel<S>& model) : model_(model) {}

  void acceleration(double time, const double* q, const double* v, double* acceleration) override {
    const Vector fixed_q = Eigen::Map<const Vector>(q), fixed_v = Eigen::Map<const Vector>(v);
    Vector fixed_acceleration;
    S::acceleration(model_.parameters(time), fixed_q, fixed_v, model_.inputs(time), fixed_acceleration);
    Eigen::Map<Vector> result(acceleration);
    result = fixed_acceleration;
  }

  double fastest_drive() const override { return model_.fastest_drive(); }
  bool depends_on_time() const override { return holds_time<S>; }
  void accelerations(const double* times, std::size_t count, const double* q, const double* v, double* found) override {
    if constexpr (holds_time<S>) {
      accelerations_in_time(model_, std::span(times, count), Eigen::Map<const Vector>(q), Eigen::Map<const Vector>(v),
                            found);
    }
  }

  std::span<const bool> arguments() const override { return argument_bases<S>(); }
  void find_arguments(double time, const double* q, const double* v, double* found) override {
    if constexpr (tells_arguments<S>) {
      typename S::template Arguments<double> arguments;
      S::call_arguments(model_.parameters(time), Vector(Eigen::Map<const Vector>(q)),
                        Vector(Eigen::Map<const Vector>(v)), model_.inputs(time), arguments);
      std::copy_n(arguments.data(), arguments.size(), found);
    }
  }

 private:
  SystemModel<S> model_;
};

}  // namespace pendula
