#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/simulation.hpp>
#include <pendula/run/system_subject.hpp>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "cli/doubts.hpp"
#include "cli/interrupt.hpp"
#include "cli/progress.hpp"
#include "cli/warnings.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/number.hpp"
#include "io/run_record.hpp"
#include "io/scenario.hpp"
#include "io/summary.hpp"
#include "io/trajectory.hpp"

namespace pendula::cli {
namespace {

/// What a scenario moves.
template <class Space>
std::shared_ptr<const Subject> subject_of(const io::Scenario<Space>& scenario) {
  return std::make_shared<ChainSubject<Space>>(scenario.chain);
}
std::shared_ptr<const Subject> subject_of(const io::SystemScenario& scenario) {
  return scenario.system;
}

/// What a summary says of it.
template <class Space>
void describe(const io::Scenario<Space>& scenario, const std::string& file, const Motion& last, io::Summary& summary) {
  summary.model = io::model_summary(file, scenario.chain, scenario.natural);
  summary.final = io::snapshot(scenario.chain, last);
}
void describe(const io::SystemScenario& scenario, const std::string& file, const Motion& last, io::Summary& summary) {
  summary.model = io::model_summary(file, *scenario.system);
  summary.system = io::snapshot(*scenario.system, last);
}

/// What only those know who see the chain.
template <class Space>
void warn_beforehand(const io::Scenario<Space>& scenario, Warnings& warnings) {
  warn_of_stiffness(scenario.chain, scenario.run, warnings);
}
void warn_beforehand(const io::SystemScenario&, Warnings&) {}
template <class Space>
bool has_poles(const io::Scenario<Space>&) {
  return Space::dof == 2;
}
bool has_poles(const io::SystemScenario&) {
  return false;
}

/// The integrator that a scenario asks for. What the runtime says of an option, `key: …`, is said at the place of that
/// key. Throws io::InputError.
std::unique_ptr<Integrator> make(const Subject& subject, const io::RunPlan& plan, const std::string& file) {
  try {
    return subject.make_integrator(plan.run);
  } catch (const NoKernel& error) {
    throw io::InputError(plan.places.at("links") + ": " + error.what());
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    const std::size_t colon = std::min(what.find(':'), what.size());
    const auto place = plan.places.find(what.substr(0, colon));
    throw io::InputError(place == plan.places.end() ? file + ": " + what : place->second + what.substr(colon));
  }
}

/// Opens the trajectory file where one is asked for. Throws io::InputError, also where that would destroy the scenario.
std::unique_ptr<io::TrajectoryFile> open_trajectory(const SimulateOptions& options,
                                                    const std::vector<std::string>& columns) {
  if (!options.output) return nullptr;
  std::error_code none_there;
  if (std::filesystem::equivalent(*options.output, options.scenario, none_there)) {
    throw io::InputError(*options.output + ": expected a file for the trajectory, got the scenario itself");
  }
  return std::make_unique<io::TrajectoryFile>(*options.output, columns);
}

/// One run: who takes the rows, and how it ended.
class Run {
 public:
  Run(std::shared_ptr<const Subject> subject, Motion start, const io::RunPlan& plan, const SimulateOptions& options)
      : subject_(std::move(subject)),
        start_(std::move(start)),
        plan_(plan),
        options_(options),
        columns_(subject_->columns()),
        integrator_(make(*subject_, plan, options.scenario)),
        file_(open_trajectory(options, columns_)),
        record_(*subject_, plan.duration),
        warnings_(!options.quiet) {
    for (const std::string& warning : plan.warnings) warnings_.add(warning);
  }

  Warnings& warnings() { return warnings_; }

  /// Never throws for a run that fails: the ending says so.
  io::Ending run(bool has_poles) {
    const io::Ending ending = integrate();
    const io::Ending written = close();
    if (ending.ok()) doubt(has_poles);
    return ending.ok() ? written : ending;
  }

  /// The last state reached.
  const Motion& last() const { return record_.rows() > 0 ? record_.last() : start_; }

  /// All of a summary but what was moved.
  io::Summary summary(const io::Ending& ending) const {
    io::Summary summary;
    summary.run = plan_.run;
    summary.description = integrator_->describe();
    summary.duration = plan_.duration;
    summary.every = plan_.every;
    summary.ending = ending;
    summary.warnings = warnings_.sentences();
    summary.statistics = integrator_->statistics();
    summary.wall_seconds = wall_seconds_;
    summary.energy_error = record_.energy_error();
    summary.energy_final = record_.energy();
    summary.table = record_.table();
    const auto [first, count] = subject_->shown_columns();
    const auto begin = columns_.begin() + static_cast<std::ptrdiff_t>(first);
    summary.shown.assign(begin, begin + static_cast<std::ptrdiff_t>(count));
    summary.rows = record_.rows();
    summary.trajectory = options_.output;
    summary.rows_written = file_ ? file_->rows() : 0;
    return summary;
  }

 private:
  io::Ending integrate() {
    const double largest_step =
        is_adaptive(plan_.run.method) ? std::numeric_limits<double>::infinity() : plan_.run.step;
    const InterruptGuard guard;
    Progress progress(plan_.duration, !options_.quiet);
    try {
      const RunResult result = simulate(
          *integrator_, start_, {largest_step, plan_.duration, plan_.every},
          [&](const Motion& motion) {
            take(motion);
            progress.at(motion.time);
          },
          [&] { return guard.interrupted(); });
      wall_seconds_ = result.stepping_seconds;
      if (!result.outcome || !result.stopped) return io::ending_of(result.outcome, subject_->coordinates());
      return {"interrupted", "interrupted at t = " + io::shortest(record_.last().time), {}, {}};
    } catch (const io::Ending& ending) {
      return ending;
    } catch (const io::OutputError& error) {
      return {"output_failed", error.what(), {}, {}};
    }
  }

  /// Throws io::Ending rather than take a row that is not finite; the energy is not wherever anything else is not.
  void take(const Motion& motion) {
    const Observation seen = subject_->observe(motion);
    if (!std::isfinite(seen.energy)) {
      throw io::Ending{
          "not_finite", "at t = " + io::shortest(motion.time) + ": the energy is not a finite number", {}, {}};
    }
    row_.clear();
    subject_->append_row(motion, seen, row_);
    record_.add(motion, seen, row_, integrator_->statistics().load_work);
    if (file_) file_->write(row_);
  }

  // What the run itself gives to doubt, and a second one with coarser steps.
  void doubt(bool has_poles) {
    const Statistics& statistics = integrator_->statistics();
    warn_of_energy(*subject_, plan_.run, record_.balance(), warnings_);
    warn_of_defect(plan_.run, statistics.largest_defect, warnings_);
    if (has_poles) warn_of_pole(integrator_->describe(), statistics, warnings_);
    if (!is_doubtful(plan_.run, statistics)) return;
    const InterruptGuard guard;
    warn_of_step(
        *subject_, plan_, start_, record_.last(), statistics, [&] { return guard.interrupted(); }, warnings_);
  }

  io::Ending close() {
    try {
      if (file_) file_->close();
      return {};
    } catch (const io::OutputError& error) {
      return {"output_failed", error.what(), {}, {}};
    }
  }

  std::shared_ptr<const Subject> subject_;
  Motion start_;
  const io::RunPlan& plan_;
  const SimulateOptions& options_;
  std::vector<std::string> columns_;
  std::unique_ptr<Integrator> integrator_;
  std::unique_ptr<io::TrajectoryFile> file_;
  io::RunRecord record_;
  Warnings warnings_;
  std::vector<double> row_;
  double wall_seconds_ = std::nan("");  // unknown where a row ended the run
};

}  // namespace

ExitStatus simulate(const SimulateOptions& options) {
  const io::FindSystem find = [&](const std::string& model, std::optional<int> links,
                                  const std::filesystem::path& folder) {
    return io::find_kernel(model, links, folder, io::Toolchain::of_this_program(),
                           [&](const std::string& what) {
                             if (!options.quiet) std::cerr << "pendula: " << what << '\n';
                           })
        .entry;
  };
  const io::AnyScenario any = io::read_scenario(options.scenario, options.overrides, find);
  return std::visit(
      [&](const auto& scenario) {
        Run run(subject_of(scenario), scenario.start, scenario, options);
        warn_beforehand(scenario, run.warnings());
        const io::Ending ending = run.run(has_poles(scenario));
        io::Summary summary = run.summary(ending);
        describe(scenario, options.scenario, run.last(), summary);
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
