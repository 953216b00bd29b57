#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <pendula/run/library.hpp>
#include <stdexcept>
#include <string>

#include "library_copies.hpp"

namespace pendula {
namespace {

// The instruction sets that cmake/PendulaLibrary.cmake compiles copies for. __builtin_cpu_supports also asks whether
// the operating system saves the registers.
bool processor_has([[maybe_unused]] std::string_view instruction_set) {
#ifdef __x86_64__
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (instruction_set == "avx2") return avx2;
  if (instruction_set == "avx512") {
    return avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512vl");
  }
#endif
  return true;
}

std::string names(bool (*wanted)(std::string_view)) {
  std::string names;
  for (const std::string_view name : instruction_sets) {
    if (wanted(name)) names += (names.empty() ? "" : ", ") + std::string(name);
  }
  return names.empty() ? "none" : names;
}

std::size_t best() {
  for (std::size_t k = instruction_sets.size(); k > 0; --k) {
    if (processor_has(instruction_sets[k - 1])) return k - 1;
  }
  throw std::runtime_error("this processor has none of the instruction sets that pendula was compiled for: " +
                           names([](std::string_view) { return true; }) +
                           "; -D PENDULA_ARCHS=\"sse2;avx2;avx512\" compiles it for any");
}

std::size_t asked_for(std::string_view name) {
  const auto found = std::ranges::find(instruction_sets, name);
  const bool is_there = found != instruction_sets.end();
  if (is_there && processor_has(name)) return static_cast<std::size_t>(found - instruction_sets.begin());
  throw std::invalid_argument("PENDULA_ARCH: expected one of " + names(processor_has) + ", got " + std::string(name) +
                              (is_there ? ", which this processor lacks" : ""));
}

std::size_t chosen() {
  static const std::size_t chosen = [] {
    const char* wanted = std::getenv("PENDULA_ARCH");
    return wanted == nullptr || *wanted == '\0' ? best() : asked_for(wanted);
  }();
  return chosen;
}

}  // namespace

template <class Part>
Part library() {
  return copies<Part>[chosen()]();
}

template ChainMaker<Planar> library();
template ChainMaker<Spatial> library();
template SystemMaker library();
template KernelList<Planar> library();
template KernelList<Spatial> library();
template KernelList<Models> library();
template LaneMovers<Planar> library();
template LaneMovers<Spatial> library();
template LaneMovers<Models> library();
template Orthonormalizer library();
template const ProgramInterpreter* library();

std::string_view instruction_set() {
  return instruction_sets[chosen()];
}

std::string_view needed_instruction_set() {
  const std::string_view least = instruction_sets.front();
  return least == "sse2" || least == "baseline" ? "" : least;
}

}  // namespace pendula
