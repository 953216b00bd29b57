#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/version.hpp>
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
#include "io/natural_units.hpp"
#include "io/scenario.hpp"
#include "io/summary.hpp"
#include "io/trajectory.hpp"
#include "view/page.hpp"
#include "view/scene.hpp"

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

/// What a page shows of it.
template <class Space>
view::Scene page_scene(const io::Scenario<Space>& scenario) {
  return view::scene_of(ChainSubject<Space>(scenario.chain));
}
view::Scene page_scene(const io::SystemScenario& scenario) {
  return view::scene_of(*scenario.system);
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

bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code none_there;
  const auto whole = [](const std::filesystem::path& path) {
    return std::filesystem::absolute(path).lexically_normal();
  };
  return whole(a) == whole(b) || std::filesystem::equivalent(a, b, none_there);
}

/// Throws io::InputError where writing `file` would destroy the scenario.
void spare_scenario(const std::string& file, const char* what, const SimulateOptions& options) {
  if (file == "-" || !is_same_file(file, options.scenario)) return;
  throw io::InputError(file + ": expected a file for the " + what + ", got the scenario itself");
}

/// Opens the trajectory file where one is asked for. Throws io::InputError.
std::unique_ptr<io::TrajectoryFile> open_trajectory(const SimulateOptions& options,
                                                    const std::vector<std::string>& columns) {
  if (!options.output) return nullptr;
  spare_scenario(*options.output, "trajectory", options);
  return std::make_unique<io::TrajectoryFile>(*options.output, columns);
}

/// Opens the page where one is asked for. Throws io::InputError.
std::unique_ptr<view::Page> open_page(const SimulateOptions& options, const view::Scene& scene) {
  if (!options.view) return nullptr;
  spare_scenario(*options.view, "page", options);
  if (*options.view == "-" || (options.output && is_same_file(*options.view, *options.output))) {
    throw io::InputError(*options.view + ": expected a file of its own for the page");
  }
  return std::make_unique<view::Page>(*options.view, scene, 1 + static_cast<std::size_t>(options.copies));
}

/// What a page shows of a scenario.
template <class Scenario>
view::Scene scene_of(const Scenario& scenario, const io::ScenarioText& text, const SimulateOptions& options) {
  view::Scene scene = page_scene(scenario);
  scene.title = std::filesystem::path(text.name).stem().string();
  scene.scenario = text.text;
  for (const std::string& change : options.overrides) scene.scenario += "# run with --set " + change + '\n';
  scene.version = version;
  const io::UnitNames units = io::unit_names(scenario.natural);
  scene.time_unit = units.time.substr(1);  // they are to follow a number
  scene.length_unit = units.length.substr(1);
  return scene;
}

/// Runs a scenario and says what came out, but for what was moved.
class Session {
 public:
  Session(RunSetup setup, const view::Scene& scene, const io::RunPlan& plan, const SimulateOptions& options)
      : setup_(std::move(setup)),
        options_(options),
        run_(run_of(setup_, plan, options.scenario)),
        page_(open_page(options, scene)),
        file_(open_trajectory(options, setup_.subject->columns())),
        progress_(setup_, !options.quiet) {
    if (file_) run_.add(*file_);
    if (page_) run_.add(*page_);
    run_.add(progress_);
    warn(plan.warnings);
    warn(run_.expected_trouble());
  }

  io::Summary run() {
    const InterruptGuard guard;
    const auto interrupted = [&] { return guard.interrupted(); };
    io::Summary summary;
    if (page_) page_->begin_run(options_.copies > 0 ? "start" : "");
    static_cast<RunReport&>(summary) = run_.go(interrupted);
    summary.run = setup_.options;
    summary.duration = setup_.duration;
    summary.every = setup_.every;
    summary.ending = io::ending_of(summary, setup_.subject->coordinates());
    if (page_) finish_page(interrupted, summary);
    warn(std::exchange(summary.warnings, {}));
    summary.warnings = warnings_;
    const std::vector<std::string> columns = setup_.subject->columns();
    const auto [first, count] = setup_.subject->shown_columns();
    const auto begin = columns.begin() + static_cast<std::ptrdiff_t>(first);
    summary.shown.assign(begin, begin + static_cast<std::ptrdiff_t>(count));
    summary.trajectory = options_.output;
    summary.view = options_.view;
    summary.rows_written = file_ ? file_->rows() : 0;
    return summary;
  }

 private:
  /// Runs the copies, and writes the page.
  void finish_page(const std::function<bool()>& interrupted, io::Summary& summary) {
    page_->end_run(summary.energy_error);
    for (int copy = 1; copy <= options_.copies && !interrupted(); ++copy) run_copy(copy, interrupted);
    if (summary.ending.ok() && options_.copies > 0 && interrupted()) {
      summary.ending = {"interrupted", "interrupted before all copies were run", {}, {}};
    }
    try {
      page_->close();
    } catch (const io::OutputError& error) {
      if (summary.ending.ok()) summary.ending = {"output_failed", error.what(), {}, {}};
    }
  }

  void run_copy(int copy, const std::function<bool()>& interrupted) {
    RunSetup setup = setup_;
    setup.start.q[0] += copy * options_.apart;
    setup.doubted = false;
    page_->begin_run("start + " + shortest(copy * options_.apart));
    Run run(setup);
    run.add(*page_);
    const RunReport report = run.go(interrupted);
    page_->end_run(report.energy_error);
    const io::Ending ending = io::ending_of(report, setup.subject->coordinates());
    if (!ending.ok() && report.end != RunEnd::stopped) {
      warn({"copy " + std::to_string(copy) + " ends early: " + ending.message});
    }
  }

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
  std::unique_ptr<view::Page> page_;  // opened first: that leaves what is there as it is
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
  const io::ScenarioText text = io::read_scenario_text(options.scenario);
  const io::AnyScenario any = io::parse_scenario(text.text, text.name, options.overrides, find);
  return std::visit(
      [&](const auto& scenario) {
        const RunSetup setup{subject_of(scenario), scenario.start, scenario.run, scenario.duration, scenario.every};
        io::Summary summary = Session(setup, scene_of(scenario, text, options), scenario, options).run();
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
