#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <pendula/numeric/directions.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/parameter_slopes.hpp>
#include <pendula/system/system_model.hpp>
#include <vector>

namespace pendula {

/// Converts tangents at one state of a system between the coordinates of derivatives of steps, (δq, δp), and those of
/// users, (δq, δv), both (2 coordinates x any). Where parameters vary, too, by (parameters x as many),
///   δp = ∂p/∂q δq + ∂p/∂v δv + ∂p/∂θ δθ.
class LagrangianVariation {
 public:
  LagrangianVariation(const SystemModel& model, const Motion& state)
      : count_(state.q.size()), p_D_q_(count_, count_), p_D_v_(count_, count_), slopes_(model) {
    SystemAt<1> here(model);
    here.set_time(state.time);
    Eigen::VectorXd p(count_), f(count_);
    Directions<> f_D_q(count_, count_), f_D_v(count_, count_);
    here(&SystemFunctions::momentum_form_with_jacobians, state.q.data(), state.v.data(), p.data(), f.data(),
         p_D_q_.data(), p_D_v_.data(), f_D_q.data(), f_D_v.data());
    slopes_.evaluate(state.time, state.q.data(), state.v.data());
  }

  void tangents(const Directions<>& rates, Directions<>& tangents) const {
    tangents = rates;
    tangents.bottomRows(count_) = p_D_q_ * rates.topRows(count_) + p_D_v_ * rates.bottomRows(count_);
  }
  void tangents(const Directions<>& rates, Directions<>& tangents, const Directions<>& parameters) const {
    this->tangents(rates, tangents);
    tangents.bottomRows(count_) += slopes_.p * parameters;
  }

  void rates(const Directions<>& tangents, Directions<>& rates) const {
    rates = tangents;
    rates.bottomRows(count_) = p_D_v_.lu().solve(tangents.bottomRows(count_) - p_D_q_ * tangents.topRows(count_));
  }
  void rates(const Directions<>& tangents, Directions<>& rates, const Directions<>& parameters) const {
    Directions<> given = tangents;
    given.bottomRows(count_) -= slopes_.p * parameters;
    this->rates(given, rates);
  }

 private:
  Eigen::Index count_;
  Directions<> p_D_q_, p_D_v_;
  ParameterSlopes slopes_;
};

}  // namespace pendula
