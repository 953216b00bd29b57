#include <unistd.h>

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
#include "cli/run_source.hpp"
#include "cli/scenario_subject.hpp"
#include "io/event_file.hpp"
#include "io/event_reader.hpp"
#include "io/file_format.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/natural_units.hpp"
#include "io/run_file.hpp"
#include "io/scenario.hpp"
#include "io/summary.hpp"
#include "io/trajectory.hpp"
#include "view/page.hpp"
#include "view/scene.hpp"

namespace pendula::cli {
namespace {

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

bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code none_there;
  const auto whole = [](const std::filesystem::path& path) {
    return std::filesystem::absolute(path).lexically_normal();
  };
  return whole(a) == whole(b) || std::filesystem::equivalent(a, b, none_there);
}

/// Throws io::InputError where writing `file` would destroy the scenario.
void spare_scenario(const std::string& file, const char* what, const SimulateOptions& options) {
  if (file == "-" || options.resume || !is_same_file(file, options.scenario)) return;
  throw io::InputError(file + ": expected a file for the " + what + ", got the scenario itself");
}

/// Whether rows go to a run file: to what a run goes on with, whatever it is called, or by the ending of the name.
bool is_run_file(const std::string& file, const SimulateOptions& options) {
  return file == options.resume || io::format_of(file) == io::FileFormat::hdf5;
}

/// Throws io::InputError where the names of files are wrong, before anything takes long.
void check_names(const SimulateOptions& options) {
  if (options.output) {
    spare_scenario(*options.output, "trajectory", options);
    is_run_file(*options.output, options);
  }
  if (!options.events) return;
  spare_scenario(*options.events, "events", options);
  if (*options.events == "-") throw io::InputError("-: expected a file of its own for the events");
  io::require_format(*options.events, io::FileFormat::csv, "events (a run file, -o run.h5, has them, too)");
}

/// The file for the rows: of a run that goes on the one that it goes on with, unless that has no rows. Throws
/// io::InputError.
std::optional<std::string> output_of(const RunSource& source, const SimulateOptions& options) {
  const bool without_rows = source.saved && !source.saved->has_rows;
  if (!options.output) return without_rows ? std::nullopt : options.resume;
  if (without_rows && is_run_file(*options.output, options)) {
    throw io::InputError(*options.output + ": expected a CSV file, got a run file, which begins with rows that " +
                         *options.resume + " does not have");
  }
  return options.output;
}

/// Opens the file for the rows; a run file that goes on begins with those that are there. Throws io::InputError.
std::unique_ptr<io::RowsFile> open_rows(const std::string& file, const SimulateOptions& options,
                                        const io::RunOrigin& origin, const std::optional<io::SavedRun>& saved,
                                        const io::RunContents& contents) {
  if (!is_run_file(file, options)) return std::make_unique<io::TrajectoryFile>(file, columns_of(contents.quantities));
  if (!saved) return std::make_unique<io::RunFile>(file, origin, contents);
  return std::make_unique<io::RunFile>(file, *options.resume, *saved, origin, contents);
}

/// The same where one is asked for, and says what it replaces.
template <class... Rest>
std::unique_ptr<io::RowsFile> open_rows(const std::optional<std::string>& file, const SimulateOptions& options,
                                        const Rest&... rest) {
  if (!file) return nullptr;
  std::error_code unknown;
  const bool replaces = file != options.resume && std::filesystem::is_regular_file(*file, unknown);
  auto opened = open_rows(*file, options, rest...);
  if (replaces && !options.quiet) std::cerr << "pendula: replacing " << *file << '\n';
  return opened;
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

std::vector<std::string> event_names(const RunSetup& setup) {
  std::vector<std::string> names;
  names.reserve(setup.events.size());
  for (const Event& event : setup.events) names.push_back(event.name);
  return names;
}

/// Throws io::InputError where there can be no file for events.
void check_events(const SimulateOptions& options, const RunSetup& setup) {
  if (!options.events) return;
  const auto is_taken = [&](const std::optional<std::string>& file) {
    return file && is_same_file(*options.events, *file);
  };
  if (is_taken(options.output) || is_taken(options.view) || is_taken(options.resume)) {
    throw io::InputError(*options.events + ": expected a file of its own for the events");
  }
  if (!setup.events.empty()) return;
  throw io::InputError("--events " + *options.events + ": expected a scenario with [[event]], got one without");
}

std::unique_ptr<io::EventFile> open_events(const SimulateOptions& options, const RunSetup& setup) {
  if (!options.events) return nullptr;
  return std::make_unique<io::EventFile>(*options.events, setup.subject->columns());
}

/// What a page shows of a scenario.
template <class Scenario>
view::Scene scene_of(const Scenario& scenario, const RunSource& source) {
  view::Scene scene = page_scene(scenario);
  scene.title = std::filesystem::path(source.text.name).stem().string();
  scene.scenario = source.text.text;
  for (const std::string& change : source.overrides) scene.scenario += "# run with --set " + change + '\n';
  scene.version = version;
  scene.time_unit = io::in_units(scenario.natural, "s");
  scene.length_unit = io::in_units(scenario.natural, "m");
  return scene;
}

/// What a run file has of a run. Quantities of a file are those that it begins with: events only where they are wanted.
io::RunContents contents_of(const RunSetup& setup, const io::RunPlan& plan, bool with_events = true) {
  return {setup.subject->quantities(), setup.subject->constants(),
          with_events ? event_names(setup) : std::vector<std::string>(), plan.natural};
}

/// Rows of a film: four to each frame of pendula_plot, so that traces are smooth between them.
const RowTimes film_times{1.0 / 120, {}};

/// The last place that a run may go on from.
class LastCheckpoint : public Observer {
 public:
  void take(const Row&) override {}
  void keep(const Checkpoint& checkpoint) override { kept = checkpoint; }

  std::optional<Checkpoint> kept;
};

/// Runs a scenario and says what came out, but for what was moved.
class RunSession {
 public:
  RunSession(RunSetup setup, const view::Scene& scene, const io::RunPlan& plan, const RunSource& source,
             const std::string& model, const SimulateOptions& options)
      : setup_(std::move(setup)),
        options_(options),
        from_(checkpoint_of(source, setup_.start.time + setup_.duration)),
        run_(told_at_keys(plan, source.text.name, [&] { return Run(setup_); })),
        origin_(origin_of(source, run_.description(), model, options.command, scene.title + ": " + scene.subject)),
        output_(output_of(source, options)),
        page_(open_page(options, scene)),
        file_(open_rows(output_, options, origin_, source.saved, contents_of(setup_, plan))),
        events_(open_events(options, setup_)),
        film_rows_(open_film_rows(contents_of(setup_, plan, false))),
        progress_(setup_, !options.quiet) {
    if (file_) run_.add(*file_);
    if (page_) run_.add(*page_, page_->times(setup_.duration));
    if (events_) run_.add(*events_);
    if (film_rows_) run_.add(*film_rows_, film_times);
    run_.add(last_);
    run_.add(progress_);
    warn(plan.warnings);
    warn(run_.expected_trouble());
  }

  io::Summary run() {
    const InterruptGuard guard;
    const auto interrupted = [&] { return guard.interrupted(); };
    io::Summary summary;
    if (page_) page_->begin_run(options_.copies > 0 ? "start" : "");
    static_cast<RunReport&>(summary) = from_ ? go_on(interrupted) : run_.go(interrupted);
    summary.accuracy = setup_.accuracy.error;
    summary.duration = setup_.duration;
    summary.every = setup_.every;
    summary.at = setup_.rows;
    summary.event_names = event_names(setup_);
    summary.event_file = options_.events;
    summary.ending = io::ending_of(summary, setup_.subject->coordinates(), summary.event_names);
    if (page_) finish_page(interrupted, summary);
    if (options_.video) make_film(summary);
    if (summary.end == RunEnd::stopped) tell_how_to_go_on(summary);
    warn(std::exchange(summary.warnings, {}));
    summary.warnings = warnings_;
    const std::vector<std::string> columns = setup_.subject->columns();
    const auto [first, count] = setup_.subject->shown_columns();
    const auto begin = columns.begin() + static_cast<std::ptrdiff_t>(first);
    summary.shown.assign(begin, begin + static_cast<std::ptrdiff_t>(count));
    summary.trajectory = output_;
    summary.view = options_.view;
    summary.rows_written = file_ ? file_->rows() : 0;
    return summary;
  }

  /// Puts the summary into the run file, which is closed then. Where that cannot be, the summary says so.
  void conclude(io::Summary& summary) {
    auto* const file = dynamic_cast<io::RunFile*>(file_.get());
    if (file == nullptr) return;
    try {
      file->conclude(io::to_json_of_file(summary));
    } catch (const io::OutputError& error) {
      if (summary.ending.ok()) summary.ending = {"output_failed", error.what(), {}, {}};
    }
  }

 private:
  /// Throws io::InputError where what the file was left with is not what these steps go on from.
  RunReport go_on(const std::function<bool()>& stop) {
    try {
      return run_.go_on(*from_, stop);
    } catch (const std::invalid_argument& error) {
      throw io::InputError(*options_.resume +
                           ": expected a file of this version of pendula, which keeps other numbers (" + error.what() +
                           ")");
    }
  }

  /// Runs the copies, and writes the page.
  void finish_page(const std::function<bool()>& interrupted, io::Summary& summary) {
    page_->end_run(summary.energy_error);
    for (int copy = 1; copy <= options_.copies && !interrupted(); ++copy) run_copy(copy, summary.options, interrupted);
    if (summary.ending.ok() && options_.copies > 0 && interrupted()) {
      summary.ending = {"interrupted", "interrupted before all copies were run", {}, {}};
    }
    try {
      page_->close();
    } catch (const io::OutputError& error) {
      if (summary.ending.ok()) summary.ending = {"output_failed", error.what(), {}, {}};
    }
  }

  /// A film is made of a run file that goes again, with rows for each frame; one of a run that goes on, of that run's,
  /// which has the rows of before.
  std::unique_ptr<io::RunFile> open_film_rows(const io::RunContents& contents) const {
    if (!options_.video || (from_ && keeps_run_file())) return nullptr;
    return std::make_unique<io::RunFile>(film_rows_name(), origin_, contents);
  }

  bool keeps_run_file() const { return output_ && is_run_file(*output_, options_); }

  std::string film_rows_name() const { return *options_.video + ".rows" + std::to_string(getpid()) + ".h5"; }

  void make_film(io::Summary& summary) {
    const std::string rows = film_rows_ ? film_rows_name() : *output_;
    if (film(rows, *options_.video) != done && summary.ending.ok()) {
      summary.ending = {"output_failed", *options_.video + ": the film could not be made", {}, {}};
    }
    std::error_code unknown;
    if (film_rows_) std::filesystem::remove(rows, unknown);
  }

  /// In the run file, or in one that has nothing else.
  void tell_how_to_go_on(io::Summary& summary) {
    if (!last_.kept) return;
    std::string file = keeps_run_file() ? *output_ : "";
    if (file.empty()) {
      const std::filesystem::path beside = output_ && output_ != "-" ? *output_ : origin_.scenario_name;
      const std::filesystem::path folder = output_ && output_ != "-" ? beside.parent_path() : "";
      file = (folder / beside.stem()).string() + ".resume.h5";
      try {
        io::write_saved_run(file, origin_, *last_.kept);
      } catch (const std::exception& error) {
        warn({std::string("the run cannot go on later: ") + error.what()});
        return;
      }
    }
    summary.ending.message += "; to go on: pendula simulate --resume " + file;
  }

  void run_copy(int copy, const RunOptions& by, const std::function<bool()>& interrupted) {
    RunSetup setup = setup_;
    setup.start.q[0] += copy * options_.apart;
    setup.options = by;
    setup.accuracy.error = 0;
    setup.doubted = false;
    page_->begin_run("start + " + rounded(copy * options_.apart));
    Run run(setup);
    run.add(*page_, page_->times(setup.duration, static_cast<std::size_t>(copy)));
    const RunReport report = run.go(interrupted);
    page_->end_run(report.energy_error);
    const io::Ending ending = io::ending_of(report, setup.subject->coordinates(), event_names(setup));
    if (!ending.ok() && report.end != RunEnd::stopped) {
      warn({"copy " + std::to_string(copy) + " ends early: " + ending.message});
    }
  }

  /// Each is told on standard error as it comes and kept for the summary.
  void warn(const std::vector<std::string>& sentences) {
    for (const std::string& sentence : sentences) {
      std::cerr << "pendula: warning: " << sentence << '\n';
      warnings_.push_back(sentence);
    }
  }

  RunSetup setup_;
  const SimulateOptions& options_;
  std::optional<Checkpoint> from_;
  Run run_;
  io::RunOrigin origin_;
  std::optional<std::string> output_;
  std::unique_ptr<view::Page> page_;  // opened first: that leaves what is there as it is
  std::unique_ptr<io::RowsFile> file_;
  std::unique_ptr<io::EventFile> events_;
  std::unique_ptr<io::RunFile> film_rows_;
  LastCheckpoint last_;
  Progress progress_;
  std::vector<std::string> warnings_;
};

}  // namespace

ExitStatus simulate(const SimulateOptions& options) {
  check_names(options);
  const RunSource source = read_run_source(options);
  if (options.video) {
    spare_scenario(*options.video, "film", options);
    if (check_film(*options.video) != done) return wrong_input;
  }
  std::string model, kernel_by = "build";
  const io::FindSystem find = [&](const std::string& name, std::optional<int> links,
                                  const std::filesystem::path& beside) {
    const io::Toolchain toolchain = io::Toolchain::of_this_program();
    const std::filesystem::path folder = options.resume ? model_folder(*options.resume, name, beside) : beside;
    model = io::model_source(name, links, folder, toolchain);
    require_same_model(source, model);
    const io::ModelKernel kernel = io::find_kernel(name, links, folder, toolchain, [&](const std::string& what) {
      if (!options.quiet) std::cerr << "pendula: " << what << '\n';
    });
    kernel_by = kernel.by();
    return kernel.table;
  };
  const io::AnyScenario any = io::parse_scenario(source.text.text, source.text.name, source.overrides, find);
  return std::visit(
      [&](const auto& scenario) {
        const std::shared_ptr<const Subject> subject = subject_of(scenario);
        const RunSetup setup{.subject = subject,
                             .start = scenario.start,
                             .options = scenario.run,
                             .duration = scenario.duration,
                             .every = scenario.every,
                             .rows = scenario.rows,
                             .accuracy = scenario.accuracy,
                             .estimate = scenario.estimate,
                             .checkpoint = scenario.checkpoint,
                             .events = io::events_of(scenario.events, subject, scenario.start)};
        check_events(options, setup);
        RunSession session(setup, scene_of(scenario, source), scenario, source, model, options);
        io::Summary summary = session.run();
        summary.kernel_by = kernel_by;
        describe(scenario, options.resume ? source.text.name : options.scenario, summary.last, summary);
        session.conclude(summary);
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
