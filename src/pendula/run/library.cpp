#include <algorithm>
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
  for (const Library* copy : library_copies) {
    if (wanted(copy->instruction_set)) names += (names.empty() ? "" : ", ") + std::string(copy->instruction_set);
  }
  return names.empty() ? "none" : names;
}

const Library& best() {
  const auto found = std::find_if(library_copies.rbegin(), library_copies.rend(),
                                  [](const Library* copy) { return processor_has(copy->instruction_set); });
  if (found != library_copies.rend()) return **found;
  throw std::runtime_error("this processor has none of the instruction sets that pendula was compiled for: " +
                           names([](std::string_view) { return true; }) +
                           "; -D PENDULA_ARCHS=\"sse2;avx2;avx512\" compiles it for any");
}

const Library& asked_for(std::string_view name) {
  const auto found = std::find_if(library_copies.begin(), library_copies.end(),
                                  [&](const Library* copy) { return copy->instruction_set == name; });
  if (found != library_copies.end() && processor_has(name)) return **found;
  const std::string why = found == library_copies.end() ? "" : ", which this processor lacks";
  throw std::invalid_argument("PENDULA_ARCH: expected one of " + names(processor_has) + ", got " + std::string(name) +
                              why);
}

}  // namespace

const Library& library() {
  static const Library* const chosen = [] {
    const char* wanted = std::getenv("PENDULA_ARCH");
    return wanted == nullptr || *wanted == '\0' ? &best() : &asked_for(wanted);
  }();
  return *chosen;
}

std::string_view needed_instruction_set() {
  const std::string_view least = library_copies.front()->instruction_set;
  return least == "sse2" || least == "baseline" ? "" : least;
}

}  // namespace pendula
