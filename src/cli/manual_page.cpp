#include "cli/help.hpp"

#include <algorithm>
#include <pendula/version.hpp>
#include <string_view>

#include "cli/command_line.hpp"

namespace pendula::cli {
namespace {

/// Escapes text for roff; hyphens stay ASCII.
std::string plain(std::string_view text) {
  std::string roff;
  for (const char c : text) {
    if (c == '\\') {
      roff += "\\e";
    } else if (c == '"') {
      roff += "\\(dq";
    } else if (c == '-') {
      roff += "\\-";
    } else if ((c == '.' || c == '\'') && roff.empty()) {
      roff.append("\\&") += c;
    } else {
      roff += c;
    }
  }
  return roff;
}

std::string section(std::string_view name) {
  return ".SH " + plain(name) + '\n';
}

/// A tagged paragraph.
std::string entry(std::string_view tag, std::string_view text) {
  return ".TP\n.B \"" + plain(tag) + "\"\n" + plain(text) + '\n';
}

/// Arguments and options, without --help, which all commands have.
std::string options(const CLI::App& command) {
  std::string text;
  const auto add = [&](const CLI::Option* option) { text += entry(typed(*option), option->get_description()); };
  std::ranges::for_each(arguments_of(command), add);
  for (const CLI::Option* option : options_of(command)) {
    if (command.get_parent() == nullptr || option != command.get_help_ptr()) add(option);
  }
  return text;
}

std::string example_lines(std::string_view command) {
  std::string text;
  for (const Example& example : examples_of(command)) {
    text += ".PP\n" + plain(example.what) + ":\n.PP\n.RS 4\n.nf\n" + plain(example.call) + "\n.fi\n.RE\n";
  }
  return text;
}

std::string keys() {
  std::string text;
  for (const io::ScenarioTable& table : io::scenario_tables()) {
    if (table.name.empty()) continue;
    text += ".SS \"" + plain(heading(table)) + "\"\n" + plain(io::find_key(table.name)->hint) + '\n';
    for (const io::ScenarioKey& key : table.keys) {
      text += entry(key.name, key.hint) + ".br\n" + plain(terms(key)) + '\n';
    }
  }
  return text;
}

}  // namespace

std::string manual_page(const CommandLine& line) {
  const auto all = [](const CLI::App*) { return true; };
  std::string text = ".TH PENDULA 1 \"\" \"pendula " + std::string(version) + "\" \"User Commands\"\n";
  text += section("NAME") +
          "pendula \\- multiple pendulums and other mechanical systems, moved by Gauss\\-Legendre methods\n";
  text += section("SYNOPSIS");
  for (const CLI::App* command : line.app.get_subcommands(all)) text += ".B " + plain(usage(*command)) + "\n.br\n";
  text += section("DESCRIPTION") + plain(line.app.get_description()) +
          "\nData go to files, the summary to standard output, progress and warnings to standard error.\n";
  text += section("OPTIONS") + options(line.app);
  text += section("COMMANDS");
  for (const CLI::App* command : line.app.get_subcommands(all)) {
    text += ".SS \"" + plain(usage(*command)) + "\"\n" + plain(command->get_description()) + ".\n" + options(*command) +
            example_lines(command->get_name());
  }
  text +=
      section("SCENARIO") +
      "A TOML file of these tables. Units are SI, angles rad; a number where an array is expected means every link.\n" +
      keys();
  text += section("EXIT STATUS") + plain(exit_status) + '\n';
  text += section("ENVIRONMENT") + plain(environment) + '\n';
  return text;
}

}  // namespace pendula::cli
