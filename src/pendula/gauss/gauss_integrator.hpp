#pragma once

#include <Eigen/Core>
#include <algorithm>
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

/// Throws std::invalid_argument where there is neither a step nor a tolerance.
inline StepperOptions stepper_options(const RunOptions& options) {
  if (!is_adaptive(options)) return {};
  if (options.tolerance > 0) return {.tolerance = options.tolerance};
  throw std::invalid_argument("tolerance: expected a positive number where no step is asked for");
}

/// Throws std::invalid_argument where fixed points are asked of a solver that has Newton only.
inline void require_newton(Iteration iteration) {
  if (iteration != Iteration::fixed_point) return;
  throw std::invalid_argument("iteration: the velocity form has newton only, got fixed-point");
}

/// How an integrator describes itself.
struct GaussDescription {
  std::string_view solver, kernel;  ///< names that outlive it
  int parts = 0;                    ///< what failures name: links of a chain, or coordinates
};

/// A GaussStepper behind the run-time interface: one virtual call a step.
template <StageSolver Solver>
class GaussIntegrator : public PlainIntegrator {
  using Model = typename Solver::Model;
  using State = typename Solver::State;

 public:
  template <class... SolverOptions>
  GaussIntegrator(const Model& model, const RunOptions& options, const GaussDescription& described,
                  const SolverOptions&... solver_options)
      : stepper_(model, options.stages, stepper_options(options), solver_options...), described_(described) {}

  Outcome start(double time, const double* q, const double* v) override {
    using Numbers = Eigen::Map<const Eigen::VectorXd>;
    return named(stepper_.start(State{time, Numbers(q, coordinates()), Numbers(v, coordinates())}));
  }
  Outcome step(double h) override { return named(stepper_.step(h)); }
  double time() const override { return stepper_.time(); }
  void read_state(double* q, double* v) const override { write(stepper_.state(), q, v); }
  void remember_steps(bool wanted) override { stepper_.remember_steps(wanted); }
  void at(double time, double* q, double* v) override { write(stepper_.at(time), q, v); }
  bool bound_excursions(double* q, double* v) const override { return stepper_.bound_excursions(q, v); }
  Outcome at_full_order(double time, double* q, double* v, double& work) override {
    State state;
    const Outcome outcome = stepper_.at_full_order(time, state, work);
    if (outcome) write(state, q, v);
    return named(outcome);
  }
  void set_stop_sign(StopSign stop) override { stepper_.set_stop_sign(stop); }
  const Statistics& statistics() const override { return stepper_.statistics(); }
  void member(MemberNumbers& numbers) override { numbers(stepper_); }
  int linearize() override {
    if constexpr (LinearizingSolver<Solver>) {
      stepper_.linearize();
      return stepper_.linearization().size();
    }
    return 0;
  }
  int conditions() const override {
    if constexpr (requires { stepper_.solver().conditions(); }) return stepper_.solver().conditions();
    return 0;
  }
  double resolved_decay(double error) const override {
    const SolverTraits traits = stepper_.solver().traits();
    return pendula::resolved_decay(traits.dissipates ? Family::radau : Family::gauss, traits.stages, error);
  }
  int parameters() override {
    if constexpr (LinearizingSolver<Solver>) return stepper_.linearization().parameters();
    return 0;
  }
  void push([[maybe_unused]] double* tangents, [[maybe_unused]] int count,
            [[maybe_unused]] const double* parameters) override {
    if constexpr (LinearizingSolver<Solver>) stepper_.linearization().push(tangents, count, parameters);
  }
  void pull([[maybe_unused]] double* gradients, [[maybe_unused]] int count,
            [[maybe_unused]] double* parameters) override {
    if constexpr (LinearizingSolver<Solver>) stepper_.linearization().pull(gradients, count, parameters);
  }
  Description describe() const override {
    return {described_.solver, name_of(stepper_.solver().iteration()), described_.kernel};
  }

 private:
  Eigen::Index coordinates() const { return stepper_.solver().traits().coordinates; }

  void write(const State& state, double* q, double* v) const {
    std::copy_n(state.q.data(), coordinates(), q);
    std::copy_n(state.v.data(), coordinates(), v);
  }

  // The coordinates θ_1..θ_n, φ_1..φ_n of link i stand n apart.
  Outcome named(Outcome outcome) const {
    if (outcome.part >= 0) outcome.part %= described_.parts;
    return outcome;
  }

  GaussStepper<Solver> stepper_;
  GaussDescription described_;
};

}  // namespace pendula
