#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/progress.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
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

/// The run that a scenario asks for. What the runtime says of an option, `key: …`, is said at the place of that key.
/// Throws io::InputError.
Run run_of(const RunSetup& setup, const io::RunPlan& plan, const std::string& file) {
  try {
    return Run(setup);
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

/// Runs a scenario and says what came out, but for what was moved.
class Session {
 public:
  Session(RunSetup setup, const io::RunPlan& plan, const SimulateOptions& options)
      : setup_(std::move(setup)),
        options_(options),
        run_(run_of(setup_, plan, options.scenario)),
        file_(open_trajectory(options, setup_.subject->columns())),
        progress_(setup_.duration, !options.quiet) {
    if (file_) run_.add(*file_);
    run_.add(progress_);
    warn(plan.warnings);
    warn(run_.expected_trouble());
  }

  io::Summary run() {
    const InterruptGuard guard;
    io::Summary summary;
    static_cast<RunReport&>(summary) = run_.go([&] { return guard.interrupted(); });
    summary.run = setup_.options;
    summary.duration = setup_.duration;
    summary.every = setup_.every;
    summary.ending = io::ending_of(summary, setup_.subject->coordinates());
    warn(std::exchange(summary.warnings, {}));
    summary.warnings = warnings_;
    const std::vector<std::string> columns = setup_.subject->columns();
    const auto [first, count] = setup_.subject->shown_columns();
    const auto begin = columns.begin() + static_cast<std::ptrdiff_t>(first);
    summary.shown.assign(begin, begin + static_cast<std::ptrdiff_t>(count));
    summary.trajectory = options_.output;
    summary.rows_written = file_ ? file_->rows() : 0;
    return summary;
  }

 private:
  /// Each is told on standard error as it comes and kept for the summary.
  void warn(const std::vector<std::string>& sentences) {
    for (const std::string& sentence : sentences) {
      if (!options_.quiet) std::cerr << "pendula: warning: " << sentence << '\n';
      warnings_.push_back(sentence);
    }
  }

  RunSetup setup_;
  const SimulateOptions& options_;
  Run run_;
  std::unique_ptr<io::TrajectoryFile> file_;
  Progress progress_;
  std::vector<std::string> warnings_;
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
        const RunSetup setup{subject_of(scenario), scenario.start, scenario.run, scenario.duration, scenario.every};
        io::Summary summary = Session(setup, scenario, options).run();
        describe(scenario, options.scenario, summary.last, summary);
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
