#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <pendula/gauss/lagrangian_tangent.hpp>
#include <pendula/numeric/directions.hpp>
#include <pendula/system/system_model.hpp>

namespace pendula {

/// The tangent space at one state of a system, between the coordinates that steps are differentiated in, (δq, δp), and
/// those of users, (δq, δv), both (2 coordinates x any). Where parameters vary, too, by (parameters x as many),
///   δp = ∂p/∂q δq + ∂p/∂v δv + ∂p/∂θ δθ.
template <System S>
class LagrangianVariation {
 public:
  LagrangianVariation(const SystemModel<S>& model, const SystemState<S>& state) {
    Vector p, f;
    Matrix f_D_q, f_D_v;
    S::momentum_form_with_jacobians(model.parameters(state.time), state.q, state.v, model.inputs(state.time), p, f,
                                    p_D_q_, p_D_v_, f_D_q, f_D_v);
    slopes_.evaluate(model, state.time, state.q, state.v);
  }

  void tangents(const Directions<>& rates, Directions<>& tangents) const {
    tangents = rates;
    tangents.bottomRows(K) = p_D_q_ * rates.topRows(K) + p_D_v_ * rates.bottomRows(K);
  }
  void tangents(const Directions<>& rates, Directions<>& tangents, const Directions<>& parameters) const {
    this->tangents(rates, tangents);
    tangents.bottomRows(K) += slopes_.p * parameters;
  }

  void rates(const Directions<>& tangents, Directions<>& rates) const {
    rates = tangents;
    rates.bottomRows(K) = p_D_v_.lu().solve(tangents.bottomRows(K) - p_D_q_ * tangents.topRows(K));
  }
  void rates(const Directions<>& tangents, Directions<>& rates, const Directions<>& parameters) const {
    Directions<> given = tangents;
    given.bottomRows(K) -= slopes_.p * parameters;
    this->rates(given, rates);
  }

 private:
  static constexpr int K = S::coordinates;
  using Vector = typename S::template Vector<double>;
  using Matrix = typename S::template Matrix<double>;

  Matrix p_D_q_, p_D_v_;
  ParameterSlopes<S> slopes_;
};

}  // namespace pendula
