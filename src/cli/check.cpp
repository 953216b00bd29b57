#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/kernel_checks.hpp>
#include <pendula/system/kernel_comparison.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "cli/motion_check.hpp"
#include "cli/usual_start.hpp"
#include "io/errors.hpp"
#include "io/generator.hpp"
#include "io/kernel_cache.hpp"
#include "io/scenario.hpp"
#include "io/toolchain.hpp"

namespace pendula::cli {
namespace {

/// Links of unequal masses and lengths; the fastest small oscillation hardly depends on their number.
template <class Space>
Chain<Space> test_chain(int links) {
  ChainParameters<Space> parameters;
  parameters.masses.resize(links);
  parameters.lengths.resize(links);
  for (int i = 0; i < links; ++i) {
    parameters.masses[i] = 1 + 0.25 * std::sin(3.0 * i);
    parameters.lengths[i] = 1 + 0.25 * std::cos(2.0 * i);
  }
  return Chain<Space>(parameters);
}

/// Spread-out links that turn around the vertical, away from the poles of (θ, φ).
template <class Space>
State<Space> test_start(int links) {
  const Eigen::VectorXd number = Eigen::VectorXd::LinSpaced(links, 0, links - 1);
  const Eigen::VectorXd theta = (1.2 + 0.3 * number.array().sin()).matrix();
  const Eigen::VectorXd theta_dot = (0.2 * (2 * number.array()).cos()).matrix();
  if constexpr (Space::dof == 1) {
    return State<Space>::from_angles(theta, theta_dot);
  } else {
    const Eigen::VectorXd phi = (0.4 * number.array().cos()).matrix();
    const Eigen::VectorXd phi_dot = (1.5 + 0.1 * number.array().sin()).matrix();
    return State<Space>::from_angles(theta, phi, theta_dot, phi_dot);
  }
}

void print(const CheckLine& line) {
  std::cout << std::left << std::setw(17) << line.kernel << std::setw(46) << line.what << std::right << std::setw(10)
            << rounded(line.measured, 3) << (line.at_least ? "  >= " : "  <= ") << std::left << std::setw(8)
            << rounded(line.limit, 3) << (line.ok() ? "ok" : "FAILED") << '\n';
}

/// The result of all lines so far.
struct Tally {
  int lines = 0, failures = 0;

  void add(const CheckLine& line) {
    print(line);
    ++lines;
    failures += line.ok() ? 0 : 1;
  }
};

constexpr unsigned seed = 1;

void add(const MotionCheck& check, std::string_view kernel, Tally& tally) {
  if (check.time() == 0) {
    tally.add(
        {kernel, "time that the motion can be followed for, s", std::numeric_limits<double>::quiet_NaN(), 0, true});
    return;
  }
  std::cout << std::left << std::setw(17) << kernel << "moved for " << rounded(check.time(), 2) << " s\n";
  for (const CheckLine& line : check.lines()) tally.add(line);
}

template <class Space>
void check_space(const CheckOptions& options, Tally& tally) {
  if (options.space && *options.space != Space::name) return;
  for (const SystemTable* kernel : library<KernelList<Space>>().tables) {
    const std::string_view name = kernel->info.name;
    const int links = kernel->info.links;
    if (options.links && *options.links != links) continue;
    // Beside each limit: the largest error of the committed kernels.
    const std::vector<KernelPoint> points = random_points(kernel->info, seed);
    tally.add({name, std::string(width_line), width_error(*kernel, points), 1e-13});  // 5.5e-16
    if (kernel->of_1.series_next != nullptr) {
      tally.add({name, std::string(series_line), series_error(*kernel, points), 1e-6});  // 2.5e-15
    }
    const ChainSubject<Space> subject(test_chain<Space>(links));
    const std::vector<std::string> units(static_cast<std::size_t>(links * Space::dof), "rad");
    const MotionCheck check(name, subject, test_start<Space>(links), units, 0);
    add(check, name, tally);
    for (const Iteration iteration : {Iteration::newton, Iteration::fixed_point}) {
      tally.add(check.dense_to_chain(iteration));
    }
  }
}

/// A model, its system, and a start.
struct ModelToCheck {
  io::ModelName name;
  std::shared_ptr<const SystemSubject> system;
  Motion start;
};

/// Compares the kernel with its model; moves it only if they agree.
void check_system(const ModelToCheck& checked, const io::Toolchain& toolchain, Tally& tally) {
  const SystemInfo& info = checked.system->info();
  const std::vector<double> said =
      io::written_values(checked.name, toolchain, checked.system->numbers().parameters, checked.start, seed);
  const KernelComparison comparison(checked.system->table(), said);
  for (const KernelLine& line : comparison.check()) {
    tally.add({info.name, std::string(line.what), line.error, line.limit});
  }
  if (tally.failures > 0) return;
  const std::vector<std::string> units(info.coordinate_units.begin(), info.coordinate_units.end());
  add(MotionCheck(info.name, *checked.system, checked.start, units, comparison.energy_rounding()), info.name, tally);
}

void check_model(const CheckOptions& options, Tally& tally) {
  const auto tell = [](const std::string& what) { std::cerr << "pendula: " << what << '\n'; };
  const io::Toolchain toolchain = io::Toolchain::of_this_program();
  ModelToCheck checked{{*options.model, options.links}, {}, {}};
  try {
    if (options.model->ends_with(".toml")) {
      const io::FindSystem find = [&](const io::ModelName& name) {
        checked.name = name;
        return io::find_kernel(name, toolchain, tell).table;
      };
      const io::AnyScenario any = io::read_scenario(*options.model, {}, find);
      const auto* scenario = std::get_if<io::SystemScenario>(&any);
      if (scenario == nullptr) throw io::InputError(*options.model + ": check: expected a scenario with [system]");
      checked.system = scenario->system;
      checked.start = scenario->start;
    } else {
      const auto kernel = io::find_kernel(checked.name, toolchain, tell).table;
      checked.system = std::make_shared<const SystemSubject>(kernel, usual_numbers(kernel->info));
      checked.start = usual_start(*checked.system, "check");
    }
    check_system(checked, toolchain, tally);
  } catch (const io::ModelError& error) {
    throw io::InputError("check: " + std::string(error.what()));
  }
}

std::string all_kernels() {
  std::string names;
  for (const KernelInfo& kernel : built_in_kernels()) names += (names.empty() ? "" : ", ") + std::string(kernel.name);
  return names.empty() ? "none" : names;
}

}  // namespace

ExitStatus check(const CheckOptions& options) {
  Tally tally;
  if (options.model) {
    check_model(options, tally);
  } else {
    check_space<Planar>(options, tally);
    check_space<Spatial>(options, tally);
  }
  if (tally.lines == 0) {
    throw io::InputError("check: expected --space and --links of a kernel in this build (" + all_kernels() + ")");
  }
  if (tally.failures == 0) {
    std::cout << "\nall " << tally.lines << " checks passed\n";
    return done;
  }
  std::cout << '\n' << tally.failures << " of " << tally.lines << " checks failed\n";
  return failed;
}

}  // namespace pendula::cli
