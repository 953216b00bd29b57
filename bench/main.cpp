// pendula_bench [--races FILE [--contestants REGEX] | --kernels FILE] [--longest SECONDS] [flags of Google Benchmark]
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <functions.hpp>
#include <iostream>
#include <lyapunov.hpp>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <race.hpp>
#include <steps.hpp>
#include <string>
#include <unit.hpp>
#include <vector>

namespace {

/// Takes `--name VALUE` out of the arguments.
std::string take(std::vector<char*>& arguments, const std::string& name, const std::string& otherwise) {
  for (std::size_t i = 1; i + 1 < arguments.size(); ++i) {
    if (arguments[i] != name) continue;
    const std::string value = arguments[i + 1];
    const auto at = arguments.begin() + static_cast<std::ptrdiff_t>(i);
    arguments.erase(at, at + 2);
    return value;
  }
  return otherwise;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<char*> arguments(argv, argv + argc);
  const std::string races = take(arguments, "--races", "");
  const std::string kernels = take(arguments, "--kernels", "");
  const std::string contestants = take(arguments, "--contestants", "");
  const double longest = std::stod(take(arguments, "--longest", "2"));
  int count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 2;
  benchmark::AddCustomContext("compiler", BENCH_COMPILER);
  benchmark::AddCustomContext("flags",
                              BENCH_FLAGS + (" with the library for " + std::string(pendula::instruction_set())));
  bench::register_unit();
  if (kernels.empty()) {
    bench::register_few_links();
    bench::register_chain_costs();
    bench::register_against_rk4imp();
    bench::register_lyapunov();
  } else {  // generated kernels: a run, and figures, of their own
    bench::register_functions();
    bench::register_kernel_races(kernels, longest);
  }
  if (!races.empty()) bench::register_races(races, longest, contestants);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
