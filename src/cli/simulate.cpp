#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/chain/invariants.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/simulation.hpp>
#include <stdexcept>
#include <string>
#include <system_error>
#include <variant>

#include "cli/commands.hpp"
#include "cli/doubts.hpp"
#include "cli/interrupt.hpp"
#include "cli/progress.hpp"
#include "cli/warnings.hpp"
#include "io/input_error.hpp"
#include "io/number.hpp"
#include "io/run_record.hpp"
#include "io/scenario.hpp"
#include "io/summary.hpp"
#include "io/trajectory.hpp"

namespace pendula::cli {
namespace {

/// The integrator that a scenario asks for. What the runtime says of an option, `key: …`, is said at the place of that
/// key. Throws io::InputError.
template <class Space>
std::unique_ptr<Integrator<Space>> make(const io::Scenario<Space>& scenario, const SimulateOptions& options) {
  try {
    return make_integrator(scenario.chain, scenario.run);
  } catch (const NoKernel& error) {
    throw io::InputError(scenario.places.at("links") + ": " + error.what());
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    const std::size_t colon = std::min(what.find(':'), what.size());
    const auto place = scenario.places.find(what.substr(0, colon));
    throw io::InputError(place == scenario.places.end() ? options.scenario + ": " + what
                                                        : place->second + what.substr(colon));
  }
}

/// Opens the trajectory file where one is asked for. Throws io::InputError, also where that would destroy the scenario.
template <class Space>
std::unique_ptr<io::TrajectoryFile<Space>> open_trajectory(const SimulateOptions& options, int links) {
  if (!options.output) return nullptr;
  std::error_code none_there;
  if (std::filesystem::equivalent(*options.output, options.scenario, none_there)) {
    throw io::InputError(*options.output + ": expected a file for the trajectory, got the scenario itself");
  }
  return std::make_unique<io::TrajectoryFile<Space>>(*options.output, links);
}

/// One run: who takes the rows, and how it ended.
template <class Space>
class Run {
 public:
  Run(const io::Scenario<Space>& scenario, const SimulateOptions& options)
      : scenario_(scenario),
        options_(options),
        integrator_(make(scenario, options)),
        file_(open_trajectory<Space>(options, scenario.chain.links())),
        record_(scenario.chain, scenario.duration),
        warnings_(!options.quiet) {
    for (const std::string& warning : scenario.warnings) warnings_.add(warning);
  }

  /// Never throws for a run that fails: the summary says so.
  io::Summary run() {
    warn_of_stiffness(scenario_, warnings_);
    const io::Ending ending = integrate();
    const io::Ending written = close();
    if (ending.ok()) doubt();
    return summary(ending.ok() ? written : ending);
  }

 private:
  io::Ending integrate() {
    const double largest_step =
        is_adaptive(scenario_.run.method) ? std::numeric_limits<double>::infinity() : scenario_.run.step;
    const InterruptGuard guard;
    Progress progress(scenario_.duration, !options_.quiet);
    try {
      const RunResult result = simulate(
          *integrator_, scenario_.start, {largest_step, scenario_.duration, scenario_.every},
          [&](const State<Space>& state) {
            take(state);
            progress.at(state.time);
          },
          [&] { return guard.interrupted(); });
      wall_seconds_ = result.stepping_seconds;
      if (!result.outcome || !result.stopped) return io::ending_of(result.outcome);
      return {"interrupted", "interrupted at t = " + io::shortest(record_.last().time), {}};
    } catch (const io::Ending& ending) {
      return ending;
    } catch (const io::OutputError& error) {
      return {"output_failed", error.what(), {}};
    }
  }

  /// Throws io::Ending rather than take a row that is not finite; the energy is not wherever anything else is not.
  void take(const State<Space>& state) {
    const Points<Space, Eigen::Dynamic> bobs = bob_positions(scenario_.chain, state);
    const Energies<double> energies = pendula::energies(scenario_.chain, state);
    if (!std::isfinite(energies.total())) {
      throw io::Ending{"not_finite", "at t = " + io::shortest(state.time) + ": the energy is not a finite number", {}};
    }
    record_.add(state, bobs, energies, integrator_->statistics().load_work);
    if (file_) file_->write(state, bobs, energies.total());
  }

  // What the run itself gives to doubt, and a second one with coarser steps.
  void doubt() {
    const Statistics& statistics = integrator_->statistics();
    warn_of_energy(scenario_, record_.balance(), warnings_);
    warn_of_defect(scenario_, statistics.largest_defect, warnings_);
    warn_of_pole(integrator_->describe(), statistics, Space::dof == 2, warnings_);
    if (!is_doubtful(scenario_, statistics)) return;
    const InterruptGuard guard;
    warn_of_step(
        scenario_, record_.last(), statistics, [&] { return guard.interrupted(); }, warnings_);
  }

  io::Ending close() {
    try {
      if (file_) file_->close();
      return {};
    } catch (const io::OutputError& error) {
      return {"output_failed", error.what(), {}};
    }
  }

  io::Summary summary(const io::Ending& ending) const {
    io::Summary summary;
    summary.model = io::model_summary(options_.scenario, scenario_.chain, scenario_.natural);
    summary.run = scenario_.run;
    summary.description = integrator_->describe();
    summary.duration = scenario_.duration;
    summary.every = scenario_.every;
    summary.ending = ending;
    summary.warnings = warnings_.sentences();
    summary.statistics = integrator_->statistics();
    summary.wall_seconds = wall_seconds_;
    summary.energy_error = record_.energy_error();
    summary.energy_final = record_.energy();
    summary.table = record_.table();
    summary.final = io::snapshot(scenario_.chain, record_.rows() > 0 ? record_.last() : scenario_.start);
    summary.rows = record_.rows();
    summary.trajectory = options_.output;
    summary.rows_written = file_ ? file_->rows() : 0;
    return summary;
  }

  const io::Scenario<Space>& scenario_;
  const SimulateOptions& options_;
  std::unique_ptr<Integrator<Space>> integrator_;
  std::unique_ptr<io::TrajectoryFile<Space>> file_;
  io::RunRecord<Space> record_;
  Warnings warnings_;
  double wall_seconds_ = std::nan("");  // unknown where a row ended the run
};

}  // namespace

ExitStatus simulate(const SimulateOptions& options) {
  const io::AnyScenario any = io::read_scenario(options.scenario, options.overrides);
  return std::visit(
      [&]<class Space>(const io::Scenario<Space>& scenario) {
        const io::Summary summary = Run<Space>(scenario, options).run();
        std::ostream& out = options.output == "-" ? std::cerr : std::cout;
        if (options.json) {
          out << io::to_json(summary);
        } else if (!options.quiet) {
          out << io::to_text(summary);
        }
        if (summary.ending.ok()) return done;
        std::cerr << "pendula: " << summary.ending.message << '\n';
        return failed;
      },
      any);
}

}  // namespace pendula::cli
