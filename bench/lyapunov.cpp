#include <benchmark/benchmark.h>

#include <lyapunov.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/lyapunov.hpp>
#include <string>

namespace bench {
namespace {

using pendula::Planar;

constexpr double duration = 100;  // s; as in heyoka_lyapunov.py

/// That of sites.google.com/view/lyapunov-spectrum, from an angle of 1.5 of both links.
void leading_exponent(benchmark::State& state, double tolerance) {
  const pendula::Chain<Planar> chain(
      {.masses = Eigen::Vector2d(0.2, 0.1), .lengths = Eigen::Vector2d(0.1, 0.08), .gravity = 9.8});
  const auto start = pendula::State<Planar>::from_angles(Eigen::Vector2d(1.5, 1.5));
  pendula::LyapunovSpectrum found;
  for (auto _ : state) {
    found = lyapunov(chain, start, {.duration = duration, .count = 1, .run = {.tolerance = tolerance}});
  }
  state.counters["exponent"] = found.exponents[0];
  state.counters["tolerance"] = tolerance;
}

}  // namespace

void register_lyapunov() {
  for (const double tolerance : {1e-9, 1e-12}) {
    const std::string name = "lyapunov/pendula/" + std::to_string(tolerance > 1e-10 ? 9 : 12) + " digits";
    benchmark::RegisterBenchmark(name.c_str(), leading_exponent, tolerance)->Unit(benchmark::kMillisecond);
  }
}

}  // namespace bench
