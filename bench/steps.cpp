#include <benchmark/benchmark.h>

#include <array>
#include <chrono>
#include <optional>
#include <peers/pendula.hpp>
#include <pendula/chain/state.hpp>
#include <sstream>
#include <steps.hpp>
#include <string>
#include <unit.hpp>
#include <utility>

namespace bench {
namespace {

using pendula::Form, pendula::Iteration, pendula::Planar, pendula::RunOptions, pendula::Solver, pendula::Spatial;

/// What is stepped, and how.
struct Case {
  std::string name;
  int links;
  RunOptions options;  ///< with the step size
};

/// A chain one metre long, horizontal but for a gentle bend and, in space, turning about the vertical: nothing is
/// special about it, no link is at the pole, and it stays like this for the steps that a benchmark takes.
template <class Space>
pendula::Chain<Space> chain_of(int links) {
  return pendula::Chain<Space>(
      {.masses = Eigen::VectorXd::Constant(links, 1.), .lengths = Eigen::VectorXd::Constant(links, 1. / links)});
}

template <class Space>
pendula::State<Space> start_of(int links) {
  const Eigen::VectorXd along = Eigen::VectorXd::LinSpaced(links, 0, 1);
  const Eigen::VectorXd theta = Eigen::VectorXd::Constant(links, 1.5) - 0.4 * along;
  if constexpr (Space::dof == 1) {
    return pendula::State<Space>::from_angles(theta);
  } else {
    return pendula::State<Space>::from_angles(theta, 0.5 * along, Eigen::VectorXd::Zero(links),
                                              Eigen::VectorXd::Constant(links, 1.));
  }
}

/// Takes steps on and on; counts what one costs, in seconds and in sincos measured between them.
template <class Space>
class Stepping {
 public:
  explicit Stepping(const Case& what)
      : links_(what.links),
        step_(what.options.step),
        start_(start_of<Space>(what.links)),
        integrator_(pendula::make_integrator(chain_of<Space>(what.links), what.options)) {}

  /// Back to the start, and past the first steps, which have no predictor.
  bool restart() {
    if (!integrator_->start(start_)) return false;
    for (int k = 0; k < 4; ++k) {
      if (!integrator_->step(step_)) return false;
    }
    return true;
  }

  void run(benchmark::State& state) {
    using Clock = std::chrono::steady_clock;
    if (!restart()) return state.SkipWithError("the first steps failed");
    const int block = std::max(1, 2000 / links_);
    double seconds = 0, units = 0;
    std::int64_t iterations = 0, steps = 0;
    for (auto _ : state) {
      if (integrator_->time() > 0.25 && !restart()) return state.SkipWithError("the first steps failed");
      const std::int64_t before = integrator_->statistics().newton_iterations;
      const double unit = sincos_nanoseconds() * 1e-9;
      const auto begin = Clock::now();
      for (int k = 0; k < block; ++k) {
        if (!integrator_->step(step_)) return state.SkipWithError("a step failed");
      }
      const double elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
      state.SetIterationTime(elapsed);
      seconds += elapsed;
      units += elapsed / unit;
      steps += block;
      iterations += integrator_->statistics().newton_iterations - before;
    }
    state.counters["step_microseconds"] = seconds / static_cast<double>(steps) * 1e6;
    state.counters["iterations_a_step"] = static_cast<double>(iterations) / static_cast<double>(steps);
    state.counters["sincos_a_link_and_iteration"] = units / static_cast<double>(iterations) / links_;
  }

 private:
  int links_;
  double step_;
  pendula::State<Space> start_;
  std::unique_ptr<pendula::Integrator> integrator_;
};

template <class Space>
void add(const Case& what) {
  const auto run = [what](benchmark::State& state) {
    try {
      Stepping<Space>(what).run(state);
    } catch (const std::exception& error) {  // a solver or kernel that this build does not have
      state.SkipWithError(error.what());
    }
  };
  benchmark::RegisterBenchmark(what.name.c_str(), run)->UseManualTime()->Unit(benchmark::kMicrosecond);
}

template <class... Parts>
std::string name_of(const Parts&... parts) {
  std::ostringstream name;
  (name << ... << parts);
  return name.str();
}

/// Steps that a user would take with so many stages.
double usual_step(int stages) {
  return stages <= 2 ? 1e-3 : stages == 4 ? 5e-3 : 1e-2;
}

/// Steps that resolve the fastest swing of the chain alike for every n (its frequency is about 2n √(g/m)).
double resolving_step(int stages, int links) {
  return (stages <= 2 ? 0.05 : stages == 4 ? 0.1 : 0.2) / links;
}

template <class Space>
void add_chain_costs(int stages, Iteration iteration) {
  for (const int links : {2, 5, 10, 20, 50, 100, 1000, 10'000, 100'000}) {
    add<Space>({name_of("chain/", Space::name, "/s=", stages, "/", iteration, "/n=", links), links,
                RunOptions{.stages = stages,
                           .solver = Solver::chain,
                           .iteration = iteration,
                           .step = resolving_step(stages, links)}});
  }
}

}  // namespace

void register_few_links() {
  const std::array<std::pair<std::string, RunOptions>, 3> solvers{{
      {"dense, momentum", {.form = Form::momentum, .solver = Solver::dense}},
      {"dense, velocity", {.form = Form::velocity, .solver = Solver::dense}},
      {"chain", {.form = Form::momentum, .solver = Solver::chain}},
  }};
  for (const auto& kernel : pendula::built_in_kernels()) {
    for (const int stages : {1, 2, 4, 8}) {
      for (auto [solver, options] : solvers) {
        options.stages = stages;
        options.step = usual_step(stages);
        const Case what{name_of("few/", kernel.name, "/s=", stages, "/", solver), kernel.links, options};
        if (kernel.space == Planar::name) {
          add<Planar>(what);
        } else {
          add<Spatial>(what);
        }
      }
    }
  }
}

void register_chain_costs() {
  for (const int stages : {2, 4, 8}) {
    for (const Iteration iteration : {Iteration::newton, Iteration::fixed_point}) {
      add_chain_costs<Planar>(stages, iteration);
      add_chain_costs<Spatial>(stages, iteration);
    }
  }
}

}  // namespace bench
