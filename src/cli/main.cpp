#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cli/command_line.hpp"
#include "cli/commands.hpp"
#include "cli/help.hpp"
#include "cli/interrupt.hpp"
#include "io/errors.hpp"
#include "io/provenance.hpp"
#include "io/scenario_keys.hpp"
#include "io/summary.hpp"

namespace pendula::cli {
namespace {

/// The message for a wrong command line, with a hint at where to read more.
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

ExitStatus print(const std::string& text) {
  std::cout << text;
  return done;
}

ExitStatus help(const CommandLine& line) {
  const HelpOptions& options = line.help_options;
  if (options.man) return print(manual_page(line));
  if (options.topic == scenario_topic) return print(options.json ? io::scenario_schema() : scenario_help());
  if (options.topic == summary_topic) return print(options.json ? io::summary_schema() : summary_help());
  if (options.topic.empty()) return print(help_text(line, line.app));
  const auto is_asked_for = [&](const CLI::App* command) { return command->get_name() == options.topic; };
  const std::vector<const CLI::App*> found = line.app.get_subcommands(is_asked_for);
  if (!found.empty()) return print(help_text(line, *found.front()));
  std::cerr << "pendula: unknown command " << options.topic << likely_meant(line.app, options.topic)
            << "\nTry 'pendula --help'.\n";
  return wrong_input;
}

/// `command` is the whole line.
ExitStatus dispatch(CommandLine& line, const std::string& command) {
  if (*line.help) return help(line);
  if (*line.completion) return print(completion_script(line.shell));
  version_text();  // throws if PENDULA_ARCH is wrong, before anything else happens
  line.simulate_options.command = line.ensemble_options.command = command;
  if (*line.simulate) return simulate(line.simulate_options);
  if (*line.check) return check(line.check_options);
  if (*line.kernels) return kernels();
  if (*line.build) return build(line.build_options);
  if (*line.new_model) return new_model(line.model_name);
  if (*line.plot) return plot(line.plot_options);
  if (*line.lyapunov) return lyapunov(line.lyapunov_options);
  if (*line.linearize) return linearize(line.linearize_options);
  if (*line.ensemble) return ensemble(line.ensemble_options);
  if (*line.map) return map(line.map_options);
  if (*line.gallery) return gallery(line.gallery_folder);
  if (*line.lab) return lab(line.lab_options);
  if (*line.exports) return export_system(line.export_options);
  if (*line.models) return models(line.models_as_json);
  if (*line.describe) return describe(line.describe_options);
  std::string commands;
  for (const CLI::App* one : line.app.get_subcommands({})) commands += (commands.empty() ? "" : ", ") + one->get_name();
  std::cerr << complaint(line, "expected a command: " + commands);
  return wrong_input;
}

/// The given status, or `failed` if standard output could not be written.
ExitStatus flushed(ExitStatus status) {
  if (std::cout.flush()) return status;
  std::cerr << "pendula: standard output could not be written\n";
  return failed;
}

/// Opens closed standard streams as unwritable ones, so that no file opened later becomes one of them.
void keep_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) < 0) static_cast<void>(open("/dev/null", O_RDONLY));  // takes the lowest free number
  }
}

/// Writes messages line by line, since ranks and mpirun share the stream.
void write_messages_by_line() {
  std::setvbuf(stderr, nullptr, _IOLBF, BUFSIZ);
  std::cerr << std::nounitbuf;
}

ExitStatus run(int argc, char** argv) {
  keep_standard_streams();
  write_messages_by_line();
  std::signal(SIGXFSZ,
              SIG_IGN);  // a limit on file sizes acts like a full disk: writing fails, and the run ends in order
  CommandLine line;
  std::vector<std::string> words(argv + 1, argv + std::max(argc, 1));
  if (words.size() > 2 && words[0] == "completion" && words[1] == candidates_flag) {
    return flushed(print(candidates(line, std::span(words).subspan(2))));
  }
  require_one_word(words);
  try {
    std::ranges::reverse(words);  // the order that CLI11 expects
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
  } catch (const pendula::io::ModelError& error) {
    std::cerr << "pendula: " << error.what() << '\n';
    return pendula::cli::wrong_input;
  } catch (const std::bad_alloc&) {
    std::cerr << "pendula: not enough memory\n";
  } catch (const std::exception& error) {
    std::cerr << "pendula: " << error.what() << '\n';
  }
  return pendula::cli::failed;
}
