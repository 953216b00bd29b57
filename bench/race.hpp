#pragma once

#include <string>

namespace bench {

/// Sends every contestant through its settings on every problem, keeps time and error of each in `file` (JSON), and
/// registers as benchmarks the cheapest setting of each that ends within 10 floors of the reference. No setting after
/// one that took longer than `longest` seconds is tried, and only contestants enter in whose name `who`, a regular
/// expression, is found.
void register_races(const std::string& file, double longest, const std::string& who);

/// The same of generated kernels, on problems of their own.
void register_kernel_races(const std::string& file, double longest);

}  // namespace bench
