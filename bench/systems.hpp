#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <numbers>
#include <pendula/kernels/cart_chain_2.hpp>
#include <pendula/kernels/furuta.hpp>
#include <pendula/kernels/spring_pendulum.hpp>
#include <pendula/kernels/swinging_atwood.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/system_subject.hpp>
#include <problems.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace bench {

/// A system that is no chain, with its numbers, and how it starts.
struct SystemStart {
  std::string_view kernel;
  std::vector<std::pair<std::string_view, std::vector<double>>> parameters;  ///< others are the model's defaults
  std::vector<pendula::InputSine> sines;
  std::vector<double> q, v;
};

/// As examples/ has them, loads and friction included.
inline const SystemStart& system_start(const Problem& problem) {
  constexpr double degree = std::numbers::pi / 180;
  static const std::vector<SystemStart> systems{
      {"cart_chain_2",
       {{"masses", {0.5, 0.25}}, {"lengths", {0.5, 0.4}}, {"cart_mass", {2}}, {"cart_friction", {0.1}}},
       {{.input = 0, .amplitude = 3, .frequency = 4, .phase = 0}},
       {0, 10 * degree, -10 * degree},
       {0, 0, 0}},
      {"spring_pendulum", {}, {}, {-0.1, 0.2, 0.1}, {0, 0, -0.1}},
      {"furuta",
       {{"arm_friction", {0.01}}, {"rod_friction", {0.0005}}},
       {{.input = 0, .amplitude = 0.5, .frequency = 6, .phase = 0}},
       {0, degree},
       {0, 0}},
      {"swinging_atwood", {}, {}, {1, 90 * degree}, {0, 0}},
  };
  const auto found = std::find_if(systems.begin(), systems.end(),
                                  [&](const SystemStart& system) { return system.kernel == problem.kernel; });
  if (found == systems.end()) throw std::invalid_argument("no system of " + std::string(problem.kernel));
  return *found;
}

/// All its numbers, in the order of the kernel that `info` tells of.
inline pendula::SystemNumbers numbers_of(const SystemStart& start, const pendula::SystemInfo& info) {
  pendula::SystemNumbers numbers{{}, std::vector<double>(info.inputs.size(), 0), start.sines};
  for (std::size_t k = 0; k < info.parameters.size(); ++k) {
    const auto is_this = [&](const auto& parameter) { return parameter.first == info.parameters[k]; };
    const auto given = std::find_if(start.parameters.begin(), start.parameters.end(), is_this);
    const auto size = static_cast<std::size_t>(info.parameter_sizes[k]);
    const std::vector<double> values =
        given != start.parameters.end() ? given->second : std::vector<double>(size, info.parameter_defaults[k]);
    numbers.parameters.insert(numbers.parameters.end(), values.begin(), values.end());
  }
  return numbers;
}

/// Calls visit.template operator()<Kernel>() with the kernel of a problem that is no chain.
template <class Visit>
auto with_kernel(const Problem& problem, Visit visit) {
  namespace kernels = pendula::kernels;
  if (problem.kernel == kernels::CartChain2::name) return visit.template operator()<kernels::CartChain2>();
  if (problem.kernel == kernels::SpringPendulum::name) return visit.template operator()<kernels::SpringPendulum>();
  if (problem.kernel == kernels::Furuta::name) return visit.template operator()<kernels::Furuta>();
  if (problem.kernel == kernels::SwingingAtwood::name) return visit.template operator()<kernels::SwingingAtwood>();
  throw std::invalid_argument("no kernel " + std::string(problem.kernel));
}

/// The system as a run moves it, by the library; nothing where this build has no kernel of it.
inline std::shared_ptr<const pendula::SystemSubject> subject_of(const Problem& problem) {
  for (const pendula::SystemTable* table : pendula::library<pendula::KernelList<pendula::Models>>().tables) {
    if (table->info.name != problem.kernel) continue;
    const std::shared_ptr<const pendula::SystemTable> kept(table, [](const pendula::SystemTable*) {});
    return std::make_shared<pendula::SystemSubject>(kept, numbers_of(system_start(problem), table->info));
  }
  return nullptr;
}

}  // namespace bench
