#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <random>
#include <unit.hpp>

namespace bench {
namespace {

constexpr std::size_t count = 4096;

const std::array<double, count>& arguments() {
  static const auto values = [] {
    std::array<double, count> angles;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(-4, 4);
    for (double& angle : angles) angle = uniform(random);
    return angles;
  }();
  return values;
}

/// One pair for each argument, the same ones in every pass: the processor has learnt libm's branches, as it does where
/// angles change smoothly. On arguments never seen before a pair takes nearly twice as long, and costs would look
/// smaller. g++ and clang make a single libm call of a pair; the store keeps calls from being merged.
void pass() {
  for (const double angle : arguments()) {
    double sine = std::sin(angle), cosine = std::cos(angle);
    benchmark::DoNotOptimize(sine);
    benchmark::DoNotOptimize(cosine);
  }
}

void unit_benchmark(benchmark::State& state) {
  for (auto _ : state) pass();
  state.counters["nanoseconds"] =
      benchmark::Counter(count * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

}  // namespace

double sincos_nanoseconds() {
  using Clock = std::chrono::steady_clock;
  std::array<double, 9> passes;
  for (double& nanoseconds : passes) {
    const auto begin = Clock::now();
    pass();
    nanoseconds = std::chrono::duration<double, std::nano>(Clock::now() - begin).count() / count;
  }
  std::nth_element(passes.begin(), passes.begin() + 2, passes.end());
  return passes[2];  // lower quartile: what disturbs a pass only makes it longer
}

void register_unit() {
  benchmark::RegisterBenchmark("sincos", unit_benchmark);
}

}  // namespace bench
