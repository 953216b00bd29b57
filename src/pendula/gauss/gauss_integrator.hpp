#pragma once

#include <pendula/gauss/stepper.hpp>
#include <pendula/integrator.hpp>
#include <sstream>
#include <utility>

namespace pendula {

/// A Gauss–Legendre stepper behind the run-time interface: one virtual call a step.
template <class StageSolver>
class GaussIntegrator : public Integrator<typename StageSolver::Space> {
  using Space = typename StageSolver::Space;

 public:
  /// `description` without the iteration, which the solver itself tells.
  template <class... SolverOptions>
  GaussIntegrator(const Chain<Space>& chain, int stages, Description description,
                  const SolverOptions&... solver_options)
      : stepper_(chain, stages, {}, solver_options...), description_(std::move(description)) {}

  Outcome start(const State<Space>& state) override { return stepper_.start(state); }
  Outcome step(double h) override { return stepper_.step(h); }
  double time() const override { return stepper_.time(); }
  State<Space> state() const override { return stepper_.state(); }
  const Statistics& statistics() const override { return stepper_.statistics(); }
  Description describe() const override {
    std::ostringstream iteration;
    iteration << stepper_.solver().iteration();
    return {description_.solver, iteration.str(), description_.kernel};
  }

 private:
  GaussStepper<StageSolver> stepper_;
  Description description_;
};

}  // namespace pendula
