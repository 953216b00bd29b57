#include "cli/command_line.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <system_error>
#include <utility>

#include "cli/help.hpp"
#include "io/errors.hpp"
#include "io/nearest_name.hpp"
#include "io/quantity_text.hpp"

namespace pendula::cli {
namespace {

/// A check of an option's text; `expected` is for the message if `accept` returns false.
CLI::Validator expect(const std::string& expected, bool (*accept)(const std::string&)) {
  return {[=](const std::string& text) {
            return accept(text) ? "" : "expected " + expected + ", got " + (text.empty() ? "an empty text" : text);
          },
          ""};
}

/// Parses I/N with 1 ≤ I ≤ N; empty for any other text.
std::optional<io::Shard> shard_of(const std::string& text) {
  io::Shard shard;
  const char* const end = text.data() + text.size();
  const auto number = std::from_chars(text.data(), end, shard.number);
  if (number.ec != std::errc() || number.ptr == end || *number.ptr != '/') return std::nullopt;
  const auto of = std::from_chars(number.ptr + 1, end, shard.of);
  if (of.ec != std::errc() || of.ptr != end || shard.number < 1 || shard.number > shard.of) return std::nullopt;
  return shard;
}

bool is_shard(const std::string& text) {
  return shard_of(text).has_value();
}

/// Parses a number; empty if the text is anything else.
template <class Number>
std::optional<Number> read_number(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

bool is_level(const std::string& text) {
  const std::size_t equals = text.rfind('=');
  return equals != std::string::npos && equals != 0 && read_number<double>(std::string_view(text).substr(equals + 1));
}

constexpr std::array<std::string_view, 5> panels = {"series", "phase", "energy", "trace", "steps"};

bool are_panels(const std::string& text) {
  std::istringstream words(text);
  bool good = !text.empty() && text.back() != ',';
  for (std::string word; std::getline(words, word, ',');) good &= std::ranges::find(panels, word) != panels.end();
  return good;
}

/// Parses size=480,speed=0.5,…; empty for any other text.
std::optional<FilmOptions> film_options(const std::string& text) {
  FilmOptions film;
  std::istringstream words(text);
  bool good = !text.empty() && text.back() != ',';
  for (std::string word; good && std::getline(words, word, ',');) {
    const std::size_t equals = std::min(word.find('='), word.size() - 1);
    const std::string_view key = std::string_view(word).substr(0, equals);
    const auto number = read_number<double>(std::string_view(word).substr(equals + 1));
    const auto take = [&](double& place, double least, double most) {
      good = number && *number >= least && *number <= most;
      if (good) place = *number;
    };
    constexpr double longest = std::numeric_limits<double>::max();
    if (key == "size") {
      take(film.size, 16, 4096);
      good = good && film.size == 2 * std::floor(film.size / 2);  // an even number, as films want it
    } else if (key == "fps") {
      take(film.fps, 1, 240);
    } else if (key == "speed") {
      take(film.speed, 1e-9, 1e9);
    } else if (key == "from") {
      take(film.from, 0, longest);
    } else if (key == "to") {
      take(film.to, 0, longest);
    } else {
      good = false;
    }
  }
  return good && film.from < film.to ? std::optional(film) : std::nullopt;
}

bool is_film(const std::string& text) {
  return film_options(text).has_value();
}

bool is_finite(const std::string& text) {
  return std::isfinite(read_number<double>(text).value_or(std::nan("")));
}

/// The number in a text; 0 if the text is anything else.
int whole_number(const std::string& text) {
  return read_number<int>(text).value_or(0);
}

[[noreturn]] void reject_two_words(const std::string& key, const std::string& next, std::string value) {
  std::erase(value, '=');
  std::string one = key.substr(0, key.find('=')) + '=' + (value.ends_with(".toml") ? "VALUE" : value);
  if (one.find_first_of(" []{}*") != std::string::npos) one = '"' + one + '"';
  throw io::InputError("--set " + key + ' ' + next +
                       ": expected KEY=VALUE without blanks around '=', got two words; write --set " + one);
}

CLI::Validator set_of(const std::vector<std::string_view>& words) {
  return CLI::IsMember(std::vector<std::string>(words.begin(), words.end()));
}

}  // namespace

CommandLine::CommandLine()
    : app("How pendulums move: chains of any length, in the plane and in space, and systems of your own.", "pendula") {
  app.formatter_fn(
      [this](const CLI::App* asked, const std::string&, CLI::AppFormatMode) { return help_text(*this, *asked); });
  app.set_version_flag("--version", version_text, "Print the version and the instruction set in use, and end");
  app.set_help_flag("-h,--help", "Print this help and end");
  app.require_subcommand(0, 1);  // `help simulate` has a subcommand
  add_simulate();
  add_ensemble();
  add_lyapunov();
  add_linearize();
  add_pictures();
  add_models();
  add_export();
  add_help();
}

CLI::Option* CommandLine::takes(CLI::Option* option, const char* type, Expected what) {
  expected[option] = std::move(what);
  return option->type_name(type);
}

CLI::Option* CommandLine::takes_file(CLI::Option* option, std::vector<std::string_view> endings) {
  return takes(option, "FILE", {.endings = std::move(endings), .is_file = true})
      ->check(expect("the name of a file", [](const std::string& text) { return !text.empty(); }));
}

CLI::Option* CommandLine::takes_words(CLI::Option* option, const char* type, std::vector<std::string_view> words) {
  option->check(set_of(words));
  return takes(option, type, {.words = std::move(words)});
}

void CommandLine::add_scenario(CLI::App* command, std::string& scenario) {
  takes_file(command->add_option("SCENARIO", scenario, "The scenario, a TOML file; - is standard input"), {".toml"});
}

void CommandLine::add_set(CLI::App* command, std::vector<std::string>& overrides) {
  CLI::Option* const set = command->add_option(
      "--set", overrides,
      "Replace a key of the scenario, as in --set run.step=1e-4 or --set run.method=rk4, or take it out, as in --set "
      "run.step=; repeatable");
  takes(set, "KEY=VALUE", {.is_key = true})->expected(1)->take_all()->allow_extra_args(false);
}

void CommandLine::add_links(CLI::App* command, std::optional<int>& links) {
  command->add_option("--links", links, "Number of links, where the model has some")
      ->type_name("N")
      ->check(expect("a whole number of links, 1 or more",
                     [](const std::string& text) { return whole_number(text) >= 1; }));
}

void CommandLine::add_simulate() {
  SimulateOptions& options = simulate_options;
  simulate = app.add_subcommand("simulate", "Run a scenario; write its trajectory, print a summary");
  add_scenario(simulate, options.scenario);
  CLI::Option* const resume =
      takes_file(simulate->add_option("--resume", options.resume, "Go on with the run of this file to a later end"),
                 {".h5", ".hdf5", ".nc"});
  resume->excludes(simulate->get_option("SCENARIO"));
  simulate->parse_complete_callback([&options] {
    if (options.scenario.empty() && !options.resume) throw CLI::RequiredError("SCENARIO");
    if (options.copies > 0 && !options.view && !options.video)
      throw CLI::RequiresError("--copies", "--view or --video");
    if (options.copies > 0 && options.resume) throw CLI::ExcludesError("--copies", "--resume");
  });
  add_set(simulate, options.overrides);
  takes_file(simulate->add_option(
                 "-o,--output", options.output,
                 "Write the trajectory to this file, as CSV where it ends in .csv, as HDF5 where in .h5, .hdf5 or "
                 ".nc; - is standard output, and standard error then has the summary"),
             {".csv", ".h5", ".hdf5", ".nc"});
  takes_file(simulate->add_option("--events", options.events, "Write what the scenario's [[event]] find to this file"),
             {".csv"});
  CLI::Option* const view =
      takes_file(simulate->add_option("--view", options.view,
                                      "Write a page to look at the motion: one HTML file that needs nothing else"),
                 {".html"});
  view->excludes(resume);
  CLI::Option* const video =
      takes_file(simulate->add_option("--video", options.video,
                                      "Write a film of the motion: .mp4 or .webm by ffmpeg, .gif or .webp without"),
                 {".mp4", ".webm", ".gif", ".webp"});
  simulate
      ->add_option_function<std::string>(
          "--film", [&options](const std::string& text) { options.film = *film_options(text); },
          "Of the film: size=640 (pixels), fps=30, speed=1 (0.5: half as fast), from=0, to=10 (seconds of the motion)")
      ->type_name("KEY=VALUE,...")
      ->check(expect("some of size=640 (even, 16 to 4096), fps=30 (1 to 240), speed=1, from=0, to=10, with commas",
                     is_film))
      ->needs(video);
  CLI::Option* const copies = simulate->add_option(
      "--copies", options.copies, "Show so many further runs in the page and the film, from starts a little apart");
  copies->type_name("N")->check(CLI::Range(1, 1000));
  simulate->add_option("--apart", options.apart, "How far one start is from the next, in the first coordinate (1e-9)")
      ->type_name("SIZE")
      ->check(expect("a number that is finite", is_finite))
      ->needs(copies);
  simulate->add_flag("--json", options.json, "Print the summary as one JSON object");
  simulate->add_flag("--quiet", options.quiet,
                     "Print no summary and no progress, but warnings, errors and what --json asks for");
}

void CommandLine::add_ensemble() {
  EnsembleOptions& options = ensemble_options;
  ensemble = app.add_subcommand("ensemble", "Move the many members of a scenario with [ensemble]");
  add_scenario(ensemble, options.scenario);
  ensemble->get_option("SCENARIO")->required();
  takes_file(ensemble->add_option("-o,--output", options.output, "The file for what came of them, HDF5"),
             {".h5", ".hdf5", ".nc"})
      ->required();
  add_set(ensemble, options.overrides);
  ensemble->add_option("--threads", options.threads, "Of each process; else all cores, of mpirun's ranks one")
      ->type_name("N")
      ->check(expect("a whole number of threads, from 1 to 1024",
                     [](const std::string& text) { return whole_number(text) >= 1 && whole_number(text) <= 1024; }));
  ensemble
      ->add_option_function<std::string>(
          "--shard", [&options](const std::string& text) { options.shard = shard_of(text); },
          "Only the I-th of N parts, which share the file: for job arrays")
      ->type_name("I/N")
      ->check(expect("I/N with 1 <= I <= N, such as 2/8", is_shard));
  ensemble->add_flag("--resume", options.resume, "Go on with what an interrupted one has left");
  ensemble->add_flag("--json", options.json, "Print the summary as one JSON object, and no progress");
  ensemble->add_flag("--quiet", options.quiet,
                     "Print no summary and no progress, but warnings, errors and what --json asks for");
}

void CommandLine::add_lyapunov() {
  LyapunovOptions& options = lyapunov_options;
  lyapunov = app.add_subcommand("lyapunov", "Find the Lyapunov exponents of a scenario's motion");
  add_scenario(lyapunov, options.scenario);
  lyapunov->get_option("SCENARIO")->required();
  lyapunov->add_option("--count", options.count, "The leading ones only, so many; else all")
      ->type_name("K")
      ->check(CLI::Range(1, 1000000));
  add_set(lyapunov, options.overrides);
  takes_file(lyapunov->add_option("-o,--output", options.output, "Write how they converge to this file"), {".csv"});
  lyapunov->add_flag("--json", options.json, "Print them as one JSON object");
}

void CommandLine::add_linearize() {
  LinearizeOptions& options = linearize_options;
  linearize = app.add_subcommand("linearize", "Print the linear system beside a scenario's start");
  add_scenario(linearize, options.scenario);
  linearize->get_option("SCENARIO")->required();
  takes_words(linearize->add_option("--at", options.at, "Beside the start, or an equilibrium near it"), "PLACE",
              {"start", "equilibrium"});
  linearize
      ->add_option("--step", options.step,
                   "The discrete system, over so many seconds or, say, 10ms, while inputs are held")
      ->type_name("TIME")
      ->check(expect("a positive time", [](const std::string& text) {
        const double step = io::number_or_quantity(text, "s").value_or(0);
        return step > 0 && std::isfinite(step);
      }));
  add_set(linearize, options.overrides);
  linearize->add_flag("--json", options.json, "Print it as one JSON object");
}

void CommandLine::add_pictures() {
  const std::vector<std::string_view> pictures = {".svg", ".png", ".pdf"};
  plot = app.add_subcommand("plot", "Draw runs, Poincare sections, Lyapunov exponents as they converge");
  takes_file(plot->add_option("RUN", plot_options.runs,
                              "Trajectories, CSV or HDF5, files of simulate --events, or of lyapunov -o; several over "
                              "each other"),
             {".csv", ".h5", ".hdf5", ".nc"})
      ->required();
  takes_file(plot->add_option("-o,--output", plot_options.output, "The picture: .svg, .png or .pdf"), pictures)
      ->required();
  takes(plot->add_option("--show", plot_options.show,
                         "Of trajectories: which of series, phase, energy, trace, steps, with commas; else what there "
                         "is"),
        "LIST", {.words = {panels.begin(), panels.end()}})
      ->check(expect("some of series, phase, energy, trace and steps, with commas", are_panels));
  plot->add_option(
          "--coordinates", plot_options.coordinates,
          "Which, with commas, as in theta_1,theta_3, else a few; of events one, against its rate, or two columns; "
          "of exponents lambda_1,...")
      ->type_name("LIST");
  plot->add_option("--phase", plot_options.phase,
                   "Phase portrait of two columns, the first to the right, as in theta_1,theta_dot_1")
      ->type_name("X,Y");
  plot->add_option("--event", plot_options.event, "Of events only these, as the other ones spoil a section")
      ->type_name("NAME");
  plot->add_option("--from", plot_options.from, "First time to show")->type_name("TIME");
  plot->add_option("--to", plot_options.to, "Last time to show")->type_name("TIME");
  plot->add_flag("--wrapped", plot_options.wrapped, "Angles from -pi to pi");

  map = app.add_subcommand("map", "Draw what is kept of an ensemble over its axes");
  takes_file(map->add_option("FILE", map_options.file, "The file of an ensemble"), {".h5", ".hdf5", ".nc"})->required();
  map->add_option("KEY", map_options.key, "A kept number, such as event_flip or energy_error")
      ->required()
      ->check(expect("the name of what is kept", [](const std::string& text) { return !text.empty(); }));
  takes_file(map->add_option("-o,--output", map_options.output, "The picture: .svg, .png or .pdf"), pictures)
      ->required();
  takes_words(map->add_option("--scale", map_options.scale, "log or linear; else what the numbers ask for"), "SCALE",
              {"log", "linear"});
  map->add_option("--contour", map_options.contour, "A line where another kept number has a value")
      ->type_name("KEY=VALUE")
      ->check(expect("KEY=VALUE such as energy_start=-9.81", is_level));

  gallery = app.add_subcommand("gallery", "Make a page of striking motions, each with its scenario");
  takes_file(gallery->add_option("DIR", gallery_folder, "The folder for it"), {"/"})->required();

  lab = app.add_subcommand("lab", "Make a page to play with a pendulum: it computes the motion itself");
  takes_file(
      lab->add_option("SCENARIO", lab_options.scenario,
                      "What to begin with: a scenario (.toml), a model file (.py) or a built-in model; else a double "
                      "pendulum"),
      {".toml", ".py"});
  add_set(lab, lab_options.overrides);
  add_links(lab, lab_options.links);
  takes_file(lab->add_option("-o,--output", lab_options.output, "The page"), {".html"})->required();
}

void CommandLine::add_models() {
  models = app.add_subcommand("models", "List the built-in models");
  models->add_flag("--json", models_as_json, "Print them as one JSON array");

  describe = app.add_subcommand("describe", "Tell what a model has: coordinates, parameters, inputs, points");
  takes_file(describe->add_option("MODEL", describe_options.model, "A model file (.py), or a built-in model"), {".py"})
      ->required();
  add_links(describe, describe_options.links);
  describe->add_flag("--json", describe_options.json, "Print it as one JSON object");

  new_model = app.add_subcommand("new-model", "Write a model file to start from");
  new_model->add_option("NAME", model_name, "Its name: letters, digits, underscores")->required();

  check = app.add_subcommand("check", "Test the kernels and methods of this build, or a model, on themselves");
  takes_file(check->add_option("MODEL", check_options.model,
                               "A model file (.py), a built-in model, or a scenario (.toml) that names one; else this "
                               "build"),
             {".py", ".toml"});
  takes_words(check->add_option("--space", check_options.space, "Only kernels of this space, planar or spatial"),
              "SPACE", {"planar", "spatial"});
  add_links(check, check_options.links);
  check->get_option("--links")->description("Only kernels of this many links");

  build = app.add_subcommand("build", "Derive and compile the kernel of a model, and keep it");
  takes_file(build->add_option("MODEL", build_options.model, "A model file (.py), or a built-in model"), {".py"})
      ->required();
  add_links(build, build_options.links);

  kernels = app.add_subcommand("kernels", "List the kernels of this build");
}

void CommandLine::add_export() {
  ExportOptions& options = export_options;
  exports = app.add_subcommand("export", "Write a system, and its Gauss step, as source for other people's programs");
  takes_file(exports->add_option("WHAT", options.what,
                                 "A model file (.py), a built-in model, a chain as planar:3, or a scenario (.toml), "
                                 "whose numbers are then those to begin with"),
             {".py", ".toml"})
      ->required();
  takes_words(exports->add_option("--as", options.language,
                                  "c: C99, NAME.h and NAME.c; casadi: functions for CasADi and acados besides; fmu: "
                                  "NAME.fmu, for simulators that know FMI 3.0, with pendula's library in it"),
              "LANGUAGE", {"c", "casadi", "fmu"})
      ->required();
  takes_file(exports->add_option("-o,--output", options.output, "The folder for the files, or the FMU: NAME.fmu"),
             {"/", ".fmu"})
      ->required();
  exports->add_option("--name", options.name, "What names in it begin with; else that of the model")->type_name("NAME");
  exports
      ->add_option(
          "--stages", options.stages,
          "Of the Gauss step of c and casadi, half its order; else the scenario's where it says its step, or 2")
      ->type_name("S")
      ->check(CLI::Range(1, 8));
  exports->add_flag("--float", options.is_float, "Numbers are float, not double");
  add_set(exports, options.overrides);
  add_links(exports, options.links);
}

void CommandLine::add_help() {
  help = app.add_subcommand("help", "Print the help of a command, all keys of scenarios, or those of summaries");
  Expected topics{.words = {scenario_topic, summary_topic}};
  for (const CLI::App* command : app.get_subcommands({})) topics.words.emplace_back(command->get_name());
  takes(help->add_option("TOPIC", help_options.topic, "A command, scenario or summary; else the program"), "TOPIC",
        std::move(topics));
  help->add_flag("--json", help_options.json, "Of scenario and summary: as a JSON Schema");
  help->add_flag("--man", help_options.man, "All of it as a manual page, for man -l");

  completion = app.add_subcommand("completion", "Print what completes commands, options, keys and files in a shell");
  takes_words(completion->add_option("SHELL", shell, "bash, zsh or fish"), "SHELL", {"bash", "zsh", "fish"})
      ->required();
}

std::string likely_meant(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  if (word.starts_with('-')) {
    for (const CLI::Option* option : app.get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  } else {
    for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  return io::did_you_mean(io::nearest_name(word.substr(0, word.find('=')), views));
}

void require_one_word(const std::vector<std::string>& words) {
  for (std::size_t k = 0; k + 2 < words.size(); ++k) {
    const std::string &key = words[k + 1], &next = words[k + 2];
    const bool is_number = read_number<double>(next).has_value();
    if (words[k] != "--set" || (next.starts_with('-') && !is_number)) continue;
    if (key.find('=') < key.size() - (is_number ? 1 : 0)) continue;
    reject_two_words(key, next, next == "=" && k + 3 < words.size() ? words[k + 3] : next);
  }
}

}  // namespace pendula::cli
