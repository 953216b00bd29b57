#include <benchmark/benchmark.h>

#include <peers/pendula.hpp>
#include <steps.hpp>

namespace bench {
namespace {

using pendula::Iteration, pendula::RunOptions, pendula::Solver;

constexpr double step = 1e-3;

/// So many steps that start-up does not count, and few enough for rk4imp's O(n³).
int steps_of(int links) {
  return links <= 2 ? 2000 : links <= 10 ? 500 : 10;
}

/// Newton of rk4imp gets through with this; on ten and a hundred links not with 1e-8.
double newton_tolerance_of(int links) {
  return links <= 2 ? 1e-12 : 1e-6;
}

template <class Make>
void add(const std::string& who, const Problem& problem, Make make) {
  const auto run = [=](benchmark::State& state) {
    try {
      const std::unique_ptr<Run> steps = make();
      for (auto _ : state) (*steps)();
      if (!std::isfinite(steps->end().theta[0])) return state.SkipWithError("the run failed");
    } catch (const std::exception& error) {
      return state.SkipWithError(error.what());
    }
    state.counters["step_microseconds"] = benchmark::Counter(
        steps_of(problem.links) * 1e-6, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  };
  const std::string name = "step/" + who + "/n=" + std::to_string(problem.links);
  benchmark::RegisterBenchmark(name.c_str(), run)->Unit(benchmark::kMicrosecond);
}

}  // namespace

void register_against_rk4imp() {
  for (const Problem& problem : {problems[0], problems[3], problems[6]}) {
    const int steps = steps_of(problem.links);
    add("GSL rk4imp", problem, [=] { return make_rk4imp(problem, steps, step, newton_tolerance_of(problem.links)); });
    for (const auto& [who, iteration] :
         {std::pair("pendula Newton", Iteration::newton), std::pair("pendula fixed point", Iteration::fixed_point)}) {
      const RunOptions options{.stages = 2, .solver = Solver::chain, .iteration = iteration};
      add(who, problem, [=] { return make_pendula(problem, options, steps, step); });
    }
  }
}

}  // namespace bench
