#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/run.hpp>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/output_files.hpp"
#include "cli/progress.hpp"
#include "io/errors.hpp"
#include "io/kernel_cache.hpp"
#include "io/run_file.hpp"
#include "io/run_source.hpp"
#include "io/scenario.hpp"
#include "io/scenario_run.hpp"
#include "io/summary.hpp"
#include "io/trajectory.hpp"
#include "view/lab.hpp"
#include "view/page.hpp"
#include "view/scenario_scene.hpp"

namespace pendula::cli {
namespace {

/// The source of a run. Throws io::InputError, too, if this program cannot resume the run.
io::RunSource read_run_source(const SimulateOptions& options) {
  if (!options.resume) return {io::read_scenario_text(options.scenario), options.overrides, {}};
  return io::resumed_source(*options.resume, io::read_saved_run(*options.resume), options.overrides);
}

/// Rows of a film: four for each frame, so that traces are smooth.
RowTimes film_times(const FilmOptions& film) {
  return {film.speed / film.fps / 4, {}};
}

/// Adds the model to a page's laboratory. If its program cannot be made, the page has no laboratory.
void add_model(view::Scene& scene, const io::ModelName& name, const SystemInfo& info) {
  try {
    const auto no_words = [](const std::string&) {};  // the making of the run's kernel was reported already
    const std::string program = io::kernel_program(name, io::Toolchain::of_this_program(), no_words);
    scene.laboratory_model = view::lab_model(info, program).dump();
  } catch (const io::ModelError&) {
    scene.laboratory.clear();
  }
}

/// Keeps the last checkpoint of a run.
class LastCheckpoint : public Observer {
 public:
  void take(const Row&) override {}
  void keep(const Checkpoint& checkpoint) override { kept = checkpoint; }

  std::optional<Checkpoint> kept;
};

/// Runs a scenario and reports the results.
class RunSession {
 public:
  RunSession(RunSetup setup, const view::Scene& scene, const io::RunPlan& plan, const io::RunSource& source,
             const std::string& model, const SimulateOptions& options)
      : setup_(std::move(setup)),
        options_(options),
        from_(io::checkpoint_of(source, setup_.start.time + setup_.duration)),
        run_(io::told_at_keys(plan, source.text.name, [&] { return Run(setup_); })),
        origin_(origin_of(source, plan, model, scene)),
        output_(output_of(source, options)),
        page_(open_page(options, scene)),
        film_contents_(contents(plan, scene, false)),
        file_(open_rows(output_, options, origin_, source.saved, contents(plan, scene))),
        events_(open_events(options, setup_)),
        film_rows_(open_film_rows()),
        progress_(setup_, !options.quiet) {
    if (file_) run_.add(*file_);
    if (page_) run_.add(*page_, page_->times(setup_.duration));
    if (events_) run_.add(*events_);
    if (film_rows_) run_.add(*film_rows_, film_times(options_.film));
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
    io::describe(run_.setup(), summary);
    summary.event_file = options_.events;
    if (page_) page_->end_run(summary.energy_error);
    run_copies(interrupted, summary);
    if (page_) finish_page(summary);
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
    if (is_filmed_) summary.film = options_.video;
    summary.rows_written = file_ ? file_->rows() : 0;
    return summary;
  }

  /// Writes the summary into the run file and closes it. If that fails, the summary says so.
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
  /// Throws io::InputError if the checkpoint of the file does not fit this run.
  RunReport go_on(const std::function<bool()>& stop) {
    try {
      return run_.go_on(*from_, stop);
    } catch (const std::invalid_argument& error) {
      throw io::InputError(*options_.resume +
                           ": expected a file of this version of pendula, which keeps other numbers (" + error.what() +
                           ")");
    }
  }

  void run_copies(const std::function<bool()>& interrupted, io::Summary& summary) {
    for (int copy = 1; copy <= options_.copies && !interrupted(); ++copy) run_copy(copy, summary.options, interrupted);
    if (summary.ending.ok() && options_.copies > 0 && interrupted()) {
      summary.ending = {"interrupted", "interrupted before all copies were run", {}, {}};
    }
  }

  void finish_page(io::Summary& summary) {
    try {
      page_->close();
    } catch (const io::OutputError& error) {
      if (summary.ending.ok()) summary.ending = {"output_failed", error.what(), {}, {}};
    }
  }

  io::RunOrigin origin_of(const io::RunSource& source, const io::RunPlan& plan, const std::string& model,
                          const view::Scene& scene) const {
    io::RunOrigin origin =
        io::origin_of(source, run_.description(), model, options_.command, scene.title + ": " + scene.subject);
    origin.overrides = io::overrides_with_numbers(source, plan.signals);
    return origin;
  }

  io::RunContents contents(const io::RunPlan& plan, const view::Scene& scene, bool with_events = true) const {
    io::RunContents contents = io::contents_of(setup_, plan, with_events);
    contents.drawing = view::drawing_of(scene);
    return contents;
  }

  /// A film is made from a temporary run file with rows for each frame; for a resumed run from its own file, which has
  /// the earlier rows.
  std::unique_ptr<io::RunFile> open_film_rows(int copy = 0) const {
    if (!options_.video || (from_ && keeps_run_file())) return nullptr;
    return std::make_unique<io::RunFile>(film_rows_name(copy), origin_, film_contents_);
  }

  bool keeps_run_file() const { return output_ && is_run_file(*output_, options_); }

  std::string film_rows_name(int copy) const {
    const std::string number = copy == 0 ? "" : "." + std::to_string(copy);
    return *options_.video + ".rows" + std::to_string(getpid()) + number + ".h5";
  }

  void make_film(io::Summary& summary) {
    std::vector<std::string> rows;
    for (int copy = 0; film_rows_ && copy <= options_.copies; ++copy) {
      if (std::filesystem::exists(film_rows_name(copy))) rows.push_back(film_rows_name(copy));
    }
    if (!film_rows_) rows.push_back(*output_);
    is_filmed_ = film(rows, *options_.video, options_.film) == done;
    if (!is_filmed_ && summary.ending.ok()) {
      summary.ending = {"output_failed", *options_.video + ": the film could not be made", {}, {}};
    }
    std::error_code unknown;
    for (const std::string& file : film_rows_ ? rows : std::vector<std::string>()) {
      std::filesystem::remove(file, unknown);
    }
  }

  /// Keeps the checkpoint in the run file, or in a file of its own.
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
    setup.subject->close(setup.start);
    setup.options = by;
    setup.accuracy.error = 0;
    setup.judged = false;
    if (page_) {
      const view::Coordinate& first = page_->scene().coordinates.front();
      page_->begin_run(first.name + " + " + rounded(setup.start.q[0] - setup_.start.q[0], 3) + ' ' + first.unit);
    }
    Run run(setup);
    if (page_) run.add(*page_, page_->times(setup.duration, static_cast<std::size_t>(copy)));
    const std::unique_ptr<io::RunFile> rows = open_film_rows(copy);
    if (rows) run.add(*rows, film_times(options_.film));
    const RunReport report = run.go(interrupted);
    if (page_) page_->end_run(report.energy_error);
    const io::Ending ending = io::ending_of(report, setup.subject->coordinates(), io::event_names(setup));
    if (!ending.ok() && report.end != RunEnd::stopped) {
      warn({"copy " + std::to_string(copy) + " ends early: " + ending.message});
    }
  }

  /// Prints a warning on standard error, and keeps it for the summary.
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
  std::unique_ptr<view::Page> page_;  // opened first; an existing file stays until it is written
  io::RunContents film_contents_;
  std::unique_ptr<io::RowsFile> file_;
  std::unique_ptr<io::EventFile> events_;
  std::unique_ptr<io::RunFile> film_rows_;
  LastCheckpoint last_;
  Progress progress_;
  bool is_filmed_ = false;
  std::vector<std::string> warnings_;
};

}  // namespace

ExitStatus simulate(const SimulateOptions& options) {
  check_names(options);
  const io::RunSource source = read_run_source(options);
  if (options.video) {
    spare_scenario(*options.video, "film", options);
    if (check_film(*options.video) != done) return wrong_input;
  }
  std::string model, kernel_by = "build";
  std::optional<io::ModelName> model_name;
  const auto tell = [&](const std::string& what) {
    if (!options.quiet) std::cerr << "pendula: " << what << '\n';
  };
  const io::FindSystem find = [&](io::ModelName name) {
    const io::Toolchain toolchain = io::Toolchain::of_this_program();
    if (options.resume) name.folder = io::model_folder(*options.resume, name.model, name.folder);
    model = io::model_source(name, toolchain);
    io::require_same_model(source, model);
    const io::ModelKernel kernel = io::find_kernel(name, toolchain, tell);
    model_name = name;
    kernel_by = kernel.by();
    return kernel.table;
  };
  const io::AnyScenario any = io::parse_scenario(source.text.text, source.text.name, source.overrides, find);
  return std::visit(
      [&](const auto& scenario) {
        const RunSetup setup = io::setup_of(scenario);
        check_events(options, setup);
        view::Scene scene = view::scene_of(scenario, source);
        if (options.view) scene.laboratory = view::laboratory_of(scenario);
        if constexpr (requires { scenario.system; }) {
          if (!scene.laboratory.empty()) add_model(scene, *model_name, scenario.system->info());
        }
        RunSession session(setup, scene, scenario, source, model, options);
        io::Summary summary = session.run();
        summary.kernel_by = kernel_by;
        io::describe(scenario, options.resume ? source.text.name : options.scenario, summary);
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
