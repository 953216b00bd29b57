#pragma once

#include <Eigen/Core>
#include <pendula/gauss/stepper.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <string_view>

namespace pendula {

/// The tableau family of an implicit method.
constexpr Family family_of(Method method) {
  return method == Method::radau ? Family::radau : Family::gauss;
}

/// A Gauss–Legendre stepper behind the run-time interface: one virtual call a step.
template <class StageSolver>
class GaussIntegrator : public PlainIntegrator {
  using Chain = typename StageSolver::Chain;
  using State = typename StageSolver::State;

 public:
  /// `solver` and `kernel` are what describe() says, literals.
  template <class... SolverOptions>
  GaussIntegrator(const Chain& chain, int stages, std::string_view solver, std::string_view kernel,
                  const SolverOptions&... solver_options)
      : stepper_(chain, stages, {}, solver_options...),
        coordinates_(StageSolver::Space::dof * chain.links()),
        solver_(solver),
        kernel_(kernel) {}

  Outcome start(double time, const double* q, const double* v) override {
    using Numbers = Eigen::Map<const Eigen::VectorXd>;
    return stepper_.start(State{time, Numbers(q, coordinates_), Numbers(v, coordinates_)});
  }
  Outcome step(double h) override { return stepper_.step(h); }
  double time() const override { return stepper_.time(); }
  void read_state(double* q, double* v) const override {
    using Numbers = Eigen::Map<Eigen::VectorXd>;
    const State state = stepper_.state();
    Numbers(q, coordinates_) = state.q;
    Numbers(v, coordinates_) = state.v;
  }
  const Statistics& statistics() const override { return stepper_.statistics(); }
  Description describe() const override { return {solver_, name_of(stepper_.solver().iteration()), kernel_}; }

 private:
  GaussStepper<StageSolver> stepper_;
  Eigen::Index coordinates_;
  std::string_view solver_, kernel_;
};

}  // namespace pendula
