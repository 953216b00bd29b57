#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <optional>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "io/input_error.hpp"
#include "io/nearest_name.hpp"
#include "io/provenance.hpp"

namespace pendula::cli {
namespace {

/// Name of the instruction set that the library computes with. Throws io::InputError where PENDULA_ARCH is wrong.
std::string instruction_set() {
  try {
    return std::string(library().instruction_set);
  } catch (const std::invalid_argument& error) {
    throw io::InputError(error.what());
  }
}

/// Added to the version where some processors can run nothing of this build.
std::string where_it_runs() {
  const std::string needed(needed_instruction_set());
  return needed.empty() ? "" : ", on processors with " + needed + " only";
}

/// The command line: what can be asked for, and what was.
struct CommandLine {
  CommandLine();

  CLI::App app{"Multiple pendulums: chains of any length, in the plane and in space, moved by Gauss-Legendre.",
               "pendula"};
  CLI::App* simulate;
  CLI::App* check;
  CLI::App* kernels;
  CLI::App* models;
  CLI::App* describe;
  CLI::App* build;
  CLI::App* new_model;
  CLI::App* plot;
  CLI::App* gallery;
  CLI::App* lyapunov;
  CLI::App* ensemble;
  CLI::App* map;
  SimulateOptions simulate_options;
  CheckOptions check_options;
  DescribeOptions describe_options;
  bool models_as_json = false;
  BuildOptions build_options;
  std::string model_name;
  PlotOptions plot_options;
  std::string gallery_folder;
  LyapunovOptions lyapunov_options;
  EnsembleOptions ensemble_options;
  MapOptions map_options;
  std::string shard;
};

/// A check of an option's text: what is expected where `accept` says no.
CLI::Validator expect(const std::string& expected, bool (*accept)(const std::string&)) {
  return {[=](const std::string& text) {
            return accept(text) ? "" : "expected " + expected + ", got " + (text.empty() ? "an empty text" : text);
          },
          ""};
}

/// I/N with 1 ≤ I ≤ N; none for any other text.
std::optional<Shard> shard_of(const std::string& text) {
  Shard shard;
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

bool is_level(const std::string& text) {
  const std::size_t equals = text.rfind('=');
  if (equals == std::string::npos || equals == 0) return false;
  double level = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data() + equals + 1, end, level);
  return read.ec == std::errc() && read.ptr == end;
}

bool are_panels(const std::string& text) {
  std::istringstream words(text);
  const std::array<std::string_view, 5> panels = {"series", "phase", "energy", "trace", "steps"};
  bool good = !text.empty() && text.back() != ',';
  for (std::string word; std::getline(words, word, ',');) good &= std::ranges::find(panels, word) != panels.end();
  return good;
}

/// 0 for anything else.
int whole_number(const std::string& text) {
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? number : 0;
}

CommandLine::CommandLine() {
  const CLI::Validator not_empty = expect("the name of a file", [](const std::string& text) { return !text.empty(); });
  const CLI::Validator one_or_more =
      expect("a whole number of links, 1 or more", [](const std::string& text) { return whole_number(text) >= 1; });
  const CLI::Validator some_threads = expect("a whole number of threads, from 1 to 1024", [](const std::string& text) {
    return whole_number(text) >= 1 && whole_number(text) <= 1024;
  });
  app.set_version_flag(
      "--version", [] { return "pendula " + std::string(version) + " (" + instruction_set() + where_it_runs() + ")"; },
      "Print the version and the instruction set in use, and end");
  app.set_help_flag("-h,--help", "Print this help and end");
  app.footer(
      "Exit status: 0 done, 1 the computation failed (rows already computed are kept), 2 the input was wrong.\n"
      "PENDULA_ARCH in the environment asks for a lesser instruction set than the best that the processor has.");

  simulate = app.add_subcommand("simulate", "Run a scenario; write its trajectory, print a summary");
  CLI::Option* scenario =
      simulate->add_option("SCENARIO", simulate_options.scenario, "The scenario, a TOML file; - is standard input");
  scenario->check(not_empty);
  CLI::Option* resume = simulate->add_option("--resume", simulate_options.resume,
                                             "Go on with the run of this file (.h5), as if it had never stopped");
  resume->type_name("FILE")->check(not_empty)->excludes(scenario);
  simulate->parse_complete_callback([this] {
    if (simulate_options.scenario.empty() && !simulate_options.resume) throw CLI::RequiredError("SCENARIO");
  });
  simulate
      ->add_option(
          "--set", simulate_options.overrides,
          "Replace a key of the scenario, as in --set run.step=1e-4 or --set run.method=rk4, or take it out, as "
          "in --set run.step=; repeatable")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);
  simulate
      ->add_option(
          "-o,--output", simulate_options.output,
          "Write the trajectory to this file, as CSV where it ends in .csv, as HDF5 where in .h5, .hdf5 or .nc; "
          "- is standard output, and standard error then has the summary")
      ->type_name("FILE")
      ->check(not_empty);
  simulate->add_option("--events", simulate_options.events, "Write what the scenario's [[event]] find to this CSV file")
      ->type_name("FILE")
      ->check(not_empty);
  CLI::Option* view = simulate->add_option("--view", simulate_options.view,
                                           "Write a page to look at the motion: one HTML file that needs nothing else");
  view->type_name("FILE")->check(not_empty)->excludes(resume);
  simulate
      ->add_option("--video", simulate_options.video,
                   "Write a film of the motion: .mp4 or .webm by ffmpeg, .gif or .webp without")
      ->type_name("FILE")
      ->check(not_empty);
  CLI::Option* copies = simulate->add_option("--copies", simulate_options.copies,
                                             "Show so many further runs in the page, from starts a little apart");
  copies->type_name("N")->needs(view)->check(CLI::Range(1, 1000));
  simulate
      ->add_option("--apart", simulate_options.apart,
                   "How far one start is from the next, in the first coordinate (1e-9)")
      ->type_name("SIZE")
      ->check(expect("a number that is finite",
                     [](const std::string& text) {
                       double size = 0;
                       const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), size);
                       return error == std::errc() && end == text.data() + text.size() && std::isfinite(size);
                     }))
      ->needs(copies);
  simulate->add_flag("--json", simulate_options.json, "Print the summary as one JSON object");
  simulate->add_flag("--quiet", simulate_options.quiet,
                     "Print no summary and no progress, but warnings, errors and what --json asks for");
  simulate->footer("Example: pendula simulate double.toml --set run.step=1e-4 -o out.csv");

  check = app.add_subcommand("check", "Test the kernels and methods of this build, or a model, on themselves");
  check
      ->add_option("MODEL", check_options.model,
                   "A model file (.py), a built-in model, or a scenario (.toml) that names one; else this build")
      ->check(not_empty);
  check->add_option("--space", check_options.space, "Only kernels of this space")
      ->check(CLI::IsMember({"planar", "spatial"}));
  check->add_option("--links", check_options.links, "Only kernels of this many links")
      ->type_name("N")
      ->check(one_or_more);

  kernels = app.add_subcommand("kernels", "List the kernels of this build");

  models = app.add_subcommand("models", "List the built-in models");
  models->add_flag("--json", models_as_json, "Print them as one JSON array");

  describe = app.add_subcommand("describe", "Tell what a model has: coordinates, parameters, inputs, points");
  describe->add_option("MODEL", describe_options.model, "A model file (.py), or a built-in model")
      ->required()
      ->check(not_empty);
  describe->add_option("--links", describe_options.links, "Number of links, where the model has some")
      ->type_name("N")
      ->check(one_or_more);
  describe->add_flag("--json", describe_options.json, "Print it as one JSON object");
  describe->footer("Example: pendula describe furuta");

  build = app.add_subcommand("build", "Derive and compile the kernel of a model, and keep it");
  build->add_option("MODEL", build_options.model, "A model file (.py), or a built-in model")
      ->required()
      ->check(not_empty);
  build->add_option("--links", build_options.links, "Number of links, where the model has some")
      ->type_name("N")
      ->check(one_or_more);

  new_model = app.add_subcommand("new-model", "Write a model file to start from");
  new_model->add_option("NAME", model_name, "Its name: letters, digits, underscores")->required();

  plot = app.add_subcommand("plot", "Draw runs, Poincare sections, Lyapunov exponents as they converge");
  plot->add_option("RUN", plot_options.runs,
                   "Trajectories, CSV or HDF5, files of simulate --events, or of lyapunov -o; several over each other")
      ->required()
      ->check(not_empty);
  plot->add_option("-o,--output", plot_options.output, "The picture: .svg, .png or .pdf")
      ->required()
      ->type_name("FILE")
      ->check(not_empty);
  plot->add_option("--show", plot_options.show,
                   "Of trajectories: which of series, phase, energy, trace, steps, with commas; else what there is")
      ->type_name("LIST")
      ->check(expect("some of series, phase, energy, trace and steps, with commas", are_panels));
  plot->add_option(
          "--coordinates", plot_options.coordinates,
          "Which, with commas, as in theta_1,theta_3, else a few; of events one, against its rate, or two columns; "
          "of exponents lambda_1,...")
      ->type_name("LIST");
  plot->add_option("--from", plot_options.from, "First time to show")->type_name("TIME");
  plot->add_option("--to", plot_options.to, "Last time to show")->type_name("TIME");
  plot->add_flag("--wrapped", plot_options.wrapped, "Angles from -pi to pi");
  plot->footer("Example: pendula plot run.h5 -o run.svg --show energy");

  lyapunov = app.add_subcommand("lyapunov", "Find the Lyapunov exponents of a scenario's motion");
  lyapunov->add_option("SCENARIO", lyapunov_options.scenario, "The scenario, a TOML file; - is standard input")
      ->required()
      ->check(not_empty);
  lyapunov->add_option("--count", lyapunov_options.count, "The leading ones only, so many; else all")
      ->type_name("K")
      ->check(CLI::Range(1, 1000000));
  lyapunov
      ->add_option("--set", lyapunov_options.overrides, "Replace a key of the scenario, as in --set run.duration=1e3")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);
  lyapunov->add_option("-o,--output", lyapunov_options.output, "Write how they converge to this file, as CSV")
      ->type_name("FILE")
      ->check(not_empty);
  lyapunov->add_flag("--json", lyapunov_options.json, "Print them as one JSON object");
  lyapunov->footer("Example: pendula lyapunov double.toml --set run.duration=1000 -o convergence.csv");

  ensemble = app.add_subcommand("ensemble", "Move the many members of a scenario with [ensemble]");
  ensemble->add_option("SCENARIO", ensemble_options.scenario, "The scenario, a TOML file")
      ->required()
      ->check(not_empty);
  ensemble->add_option("-o,--output", ensemble_options.output, "The file for what came of them, HDF5")
      ->required()
      ->type_name("FILE")
      ->check(not_empty);
  ensemble
      ->add_option("--set", ensemble_options.overrides, "Replace a key of the scenario, as in --set run.duration=20")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);
  ensemble->add_option("--threads", ensemble_options.threads, "Of each process; else all cores, of mpirun's ranks one")
      ->type_name("N")
      ->check(some_threads);
  ensemble->add_option("--shard", shard, "Only the I-th of N parts, which share the file: for job arrays")
      ->type_name("I/N")
      ->check(expect("I/N with 1 <= I <= N, such as 2/8", is_shard));
  ensemble->add_flag("--resume", ensemble_options.resume, "Go on with what an interrupted one has left");
  ensemble->add_flag("--json", ensemble_options.json, "Print the summary as one JSON object, and no progress");
  ensemble->footer("Example: pendula ensemble examples/flip_map.toml -o flips.h5");

  map = app.add_subcommand("map", "Draw what is kept of an ensemble over its axes");
  map->add_option("FILE", map_options.file, "The file of an ensemble")->required()->check(not_empty);
  map->add_option("KEY", map_options.key, "A kept number, such as event_flip or energy_error")
      ->required()
      ->check(not_empty);
  map->add_option("-o,--output", map_options.output, "The picture: .svg, .png or .pdf")
      ->required()
      ->type_name("FILE")
      ->check(not_empty);
  map->add_option("--scale", map_options.scale, "log or linear; else what the numbers ask for")
      ->type_name("SCALE")
      ->check(CLI::IsMember({"log", "linear"}));
  map->add_option("--contour", map_options.contour, "A line where another kept number has a value")
      ->type_name("KEY=VALUE")
      ->check(expect("KEY=VALUE such as energy_start=-9.81", is_level));
  map->footer("Example: pendula map flips.h5 event_flip -o flips.png");

  gallery = app.add_subcommand("gallery", "Make a page of striking motions, each with its scenario");
  gallery->add_option("DIR", gallery_folder, "The folder for it")->required()->check(not_empty);

  app.add_subcommand("help", "Print the help of a command: pendula help COMMAND");
}

/// What an unknown word may have been meant for: an option of `app`, or a command.
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

/// What is wrong with a command line, and where to read more.
std::string complaint(const CommandLine& line, const std::string& what) {
  const std::vector<CLI::App*> chosen = line.app.get_subcommands();
  const CLI::App& app = chosen.empty() ? line.app : *chosen.front();
  const std::string command = chosen.empty() ? "pendula" : "pendula " + app.get_name();
  const std::vector<std::string> unexpected = line.app.remaining(true);
  std::string text = what;
  if (!unexpected.empty()) {
    const std::string& word = unexpected.front();
    const std::string kind = word.starts_with('-') ? "option" : chosen.empty() ? "command" : "argument";
    text = "unknown " + kind + " " + word + likely_meant(app, word);
  }
  return command + ": " + text + "\nTry '" + command + " --help'.\n";
}

/// `command` is the whole line.
ExitStatus dispatch(const CommandLine& line, const std::string& command) {
  instruction_set();  // whether it is wrong, before anything else is
  if (*line.simulate) {
    SimulateOptions options = line.simulate_options;
    options.command = command;
    return simulate(options);
  }
  if (*line.check) return check(line.check_options);
  if (*line.kernels) return kernels();
  if (*line.build) return build(line.build_options);
  if (*line.new_model) return new_model(line.model_name);
  if (*line.plot) return plot(line.plot_options);
  if (*line.lyapunov) return lyapunov(line.lyapunov_options);
  if (*line.ensemble) {
    EnsembleOptions options = line.ensemble_options;
    options.command = command;
    options.shard = shard_of(line.shard);
    return ensemble(options);
  }
  if (*line.map) return map(line.map_options);
  if (*line.gallery) return gallery(line.gallery_folder);
  if (*line.models) return models(line.models_as_json);
  if (*line.describe) return describe(line.describe_options);
  std::cerr << complaint(
      line,
      "expected a command: simulate, ensemble, lyapunov, plot, map, gallery, models, describe, check, kernels, build, "
      "new-model or help");
  return wrong_input;
}

/// The status, unless what was printed could not be written.
ExitStatus flushed(ExitStatus status) {
  if (std::cout.flush()) return status;
  std::cerr << "pendula: standard output could not be written\n";
  return failed;
}

/// Standard streams that are closed: a file opened later must not become one of them. They stay unwritable.
void keep_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) < 0) static_cast<void>(open("/dev/null", O_RDONLY));  // takes the lowest free number
  }
}

/// Messages leave a line at a time: ranks, and mpirun itself, write to the same stream.
void write_messages_by_line() {
  std::setvbuf(stderr, nullptr, _IOLBF, BUFSIZ);
  std::cerr << std::nounitbuf;
}

/// What was typed after the program's name; `help COMMAND` is `COMMAND --help`.
std::vector<std::string> words_of(int argc, char** argv, const CLI::App& app) {
  std::vector<std::string> words(argv + 1, argv + std::max(argc, 1));
  if (words.empty() || words.front() != "help") return words;
  if (words.size() == 1) return {"--help"};
  words.erase(words.begin());
  const auto is_asked_for = [&](const CLI::App* command) { return command->get_name() == words.front(); };
  if (!app.get_subcommands(is_asked_for).empty()) words.insert(words.begin() + 1, "--help");
  return words;
}

ExitStatus run(int argc, char** argv) {
  keep_standard_streams();
  write_messages_by_line();
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is a full disk: writing fails, the run ends in order
  CommandLine line;
  try {
    std::vector<std::string> words = words_of(argc, argv, line.app);
    std::ranges::reverse(words);  // as CLI11 takes them
    line.app.parse(std::move(words));
  } catch (const CLI::Success& asked) {  // --help, --version
    line.app.exit(asked);
    return flushed(done);
  } catch (const CLI::ParseError& error) {
    std::cerr << complaint(line, error.what());
    return wrong_input;
  }
  return flushed(dispatch(line, io::command_line(std::span(argv, static_cast<std::size_t>(argc)))));
}

}  // namespace
}  // namespace pendula::cli

int main(int argc, char** argv) {
  pendula::cli::restore_hang_up();
  try {
    return pendula::cli::run(argc, argv);
  } catch (const pendula::io::InputError& error) {
    std::cerr << "pendula: " << error.what() << '\n';
    return pendula::cli::wrong_input;
  } catch (const std::bad_alloc&) {
    std::cerr << "pendula: not enough memory\n";
  } catch (const std::exception& error) {
    std::cerr << "pendula: " << error.what() << '\n';
  }
  return pendula::cli::failed;
}
