#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/lyapunov.hpp>
#include <string>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/read_scenario.hpp"
#include "io/files.hpp"
#include "io/scenario.hpp"
#include "io/scenario_run.hpp"
#include "io/trajectory.hpp"

namespace pendula::cli {
namespace {

/// A CSV file of the exponents as they converge: t, then a column for each.
class HistoryFile {
 public:
  HistoryFile(const std::string& name, int count) : file_(name) {
    file_.pending() += "t";
    for (int k = 1; k <= count; ++k) file_.pending() += ",lambda_" + std::to_string(k);
    file_.pending() += '\n';
  }

  void add(const LyapunovProgress& progress) {
    file_.pending() += shortest(progress.time);
    for (const double exponent : progress.exponents) file_.pending() += ',' + shortest(exponent);
    file_.pending() += '\n';
    file_.flush_if_due();
  }

  void close() { file_.close(); }

 private:
  io::LineFile file_;
};

std::vector<double> numbers(const Eigen::VectorXd& x) {
  return {x.begin(), x.end()};
}

std::string to_json(const LyapunovRun& found, const Statistics& statistics) {
  const nlohmann::ordered_json json{{"exponents", numbers(found.exponents)},
                                    {"exponents_error", numbers(found.errors)},
                                    {"sum", found.sum},
                                    {"duration", found.duration},
                                    {"averaged_from", found.since},
                                    {"ftle", found.ftle},
                                    {"megno", found.megno},
                                    {"steps", statistics.steps},
                                    {"wall_seconds", found.result.stepping_seconds}};
  return json.dump(2) + "\n";
}

void print_text(const LyapunovSpectrum& found, const Statistics& statistics, const std::string& second) {
  std::cout << std::left << std::setw(19) << "duration" << shortest(found.duration) << ' ' << second << ", "
            << statistics.steps << " steps\n"
            << std::setw(19) << "averaged"
            << "from " << rounded(found.since, 6) << ' ' << second
            << " on, when tangents have found their directions\n\n"
            << std::right << std::setw(5) << "" << std::setw(14) << ("1/" + second) << std::setw(12) << "error" << '\n';
  for (Eigen::Index k = 0; k < found.exponents.size(); ++k) {
    std::cout << std::setw(5) << k + 1 << std::setprecision(6) << std::setw(14) << found.exponents[k]
              << std::setprecision(2) << std::setw(12) << found.errors[k] << '\n';
  }
  std::cout << '\n'
            << std::left << std::setprecision(6) << std::setw(19) << "sum" << found.sum << '\n'
            << std::setw(19) << "finite time" << found.ftle
            << "      of one tangent from the start on, as the last row of -o has it\n"
            << std::setw(19) << "MEGNO" << found.megno << "      2 where motion is regular\n";
}

template <class Scenario>
ExitStatus run(const Scenario& scenario, const LyapunovOptions& options) {
  const std::shared_ptr<const Subject> subject = io::subject_of(scenario);
  const InterruptGuard guard;
  const std::unique_ptr<Integrator> integrator = subject->make_integrator(scenario.options);
  integrator->linearize();
  integrator->start(scenario.start);
  const int all = 2 * static_cast<int>(scenario.start.q.size()) - integrator->conditions();
  if (const auto accuracy = scenario.places.find("accuracy"); accuracy != scenario.places.end()) {
    std::cerr << "pendula: warning: " << accuracy->second
              << ": has no effect on exponents, which go by run.tolerance\n";
  }
  std::optional<HistoryFile> history;
  if (options.output) history.emplace(*options.output, options.count == 0 ? all : options.count);
  const auto on_way = [&](const LyapunovProgress& progress) {
    if (history) history->add(progress);
  };
  const LyapunovRun found =
      find_lyapunov_spectrum(*integrator, scenario.start, longest_step(scenario.options), scenario.duration,
                             options.count, on_way, [&] { return guard.interrupted(); });
  if (history) history->close();
  if (options.json) {
    std::cout << to_json(found, integrator->statistics());
  } else {
    print_text(found, integrator->statistics(), io::in_units(scenario.natural, "s"));
  }
  if (found.result.outcome && !found.result.stopped) return done;
  std::cerr << "pendula: "
            << (found.result.stopped ? "interrupted"
                                     : message(found.result.outcome, subject->coordinates(), subject->switches()))
            << '\n';
  return failed;
}

}  // namespace

ExitStatus lyapunov(const LyapunovOptions& options) {
  if (options.output) io::require_format(*options.output, io::FileFormat::csv, "exponents as they converge");
  return std::visit(
      [&](const auto& scenario) {
        return io::told_at_keys(scenario, options.scenario, [&] { return run(scenario, options); });
      },
      read_scenario(options.scenario, options.overrides, options.json));
}

}  // namespace pendula::cli
