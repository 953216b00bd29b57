#pragma once

#include <Eigen/Core>
#include <pendula/gauss/stepper.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <stdexcept>
#include <string_view>

namespace pendula {

/// The tableau family of an implicit method.
constexpr Family family_of(Method method) {
  return method == Method::radau ? Family::radau : Family::gauss;
}

/// Throws std::invalid_argument where a solver that has Newton only is asked for fixed points.
inline void require_newton(Iteration iteration) {
  if (iteration != Iteration::fixed_point) return;
  throw std::invalid_argument("iteration: the velocity form has newton only, got fixed-point");
}

/// What an integrator says of itself.
struct GaussDescription {
  std::string_view solver, kernel;  ///< literals
  int parts = 0;                    ///< what failures name: links of a chain, or coordinates
};

/// A Gauss–Legendre stepper behind the run-time interface: one virtual call a step.
template <StageSolver Solver>
class GaussIntegrator : public PlainIntegrator {
  using Model = typename Solver::Model;
  using State = typename Solver::State;

 public:
  template <class... SolverOptions>
  GaussIntegrator(const Model& model, int stages, const GaussDescription& described,
                  const SolverOptions&... solver_options)
      : stepper_(model, stages, {}, solver_options...), described_(described) {}

  Outcome start(double time, const double* q, const double* v) override {
    using Numbers = Eigen::Map<const Eigen::VectorXd>;
    return named(stepper_.start(State{time, Numbers(q, coordinates()), Numbers(v, coordinates())}));
  }
  Outcome step(double h) override { return named(stepper_.step(h)); }
  double time() const override { return stepper_.time(); }
  void read_state(double* q, double* v) const override {
    using Numbers = Eigen::Map<Eigen::VectorXd>;
    const State state = stepper_.state();
    Numbers(q, coordinates()) = state.q;
    Numbers(v, coordinates()) = state.v;
  }
  const Statistics& statistics() const override { return stepper_.statistics(); }
  void member(MemberNumbers& numbers) override { numbers(stepper_); }
  Description describe() const override {
    return {described_.solver, name_of(stepper_.solver().iteration()), described_.kernel};
  }

 private:
  Eigen::Index coordinates() const { return stepper_.solver().coordinates(); }

  // Coordinates of a chain are ordered by kind, those of one link a number of links apart.
  Outcome named(Outcome outcome) const {
    if (outcome.part >= 0) outcome.part %= described_.parts;
    return outcome;
  }

  GaussStepper<Solver> stepper_;
  GaussDescription described_;
};

}  // namespace pendula
