#include "cli/help.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <sstream>
#include <stdexcept>

#include "cli/command_line.hpp"
#include "io/errors.hpp"
#include "io/summary.hpp"

namespace pendula::cli {
namespace {

constexpr std::array<Example, 28> examples = {{
    {"simulate", "pendula simulate examples/double_pendulum.toml -o run.csv", "write a trajectory, print a summary"},
    {"simulate", "pendula simulate examples/double_pendulum.toml --set run.accuracy=1e-12 --json",
     "with another accuracy; the summary as JSON"},
    {"simulate", "pendula simulate examples/double_pendulum.toml --set \"start.theta=120 deg\" --view run.html",
     "from another start; a page to look at the motion"},
    {"simulate", "pendula simulate examples/poincare.toml --events section.csv", "write where its events happen"},
    {"simulate", "pendula simulate examples/double_pendulum.toml -o run.h5", "keep a run that can go on later"},
    {"simulate", "pendula simulate --resume run.h5 --set run.duration=20", "go on with it"},
    {"ensemble", "pendula ensemble examples/flip_map.toml --set run.duration=5 -o flips.h5", "a grid of shorter runs"},
    {"ensemble", "pendula ensemble examples/flip_map.toml -o many.h5 --shard 2/8",
     "the second of eight parts, as a job of an array"},
    {"lyapunov", "pendula lyapunov examples/poincare.toml --set run.duration=100 -o exponents.csv",
     "all exponents, and how they converge"},
    {"lyapunov", "pendula lyapunov examples/poincare.toml --set run.duration=100 --count 1 --json",
     "the leading one as JSON"},
    {"linearize", "pendula linearize examples/double_pendulum.toml --at equilibrium",
     "A, B and eigenvalues where it hangs"},
    {"linearize", "pendula linearize examples/double_pendulum.toml --step 0.01 --json", "the discrete system, as JSON"},
    {"plot", "pendula plot run.h5 -o run.svg --show series,energy", "coordinates and energy errors"},
    {"plot", "pendula plot section.csv -o section.svg", "a Poincare section"},
    {"map", "pendula map flips.h5 event_flip -o flips.png", "when an event happened, over the axes"},
    {"gallery", "pendula gallery out/gallery", "twelve striking motions; takes a few minutes"},
    {"lab", "pendula lab examples/double_pendulum.toml -o lab.html", "a page to take the pendulum in the hand"},
    {"export", "pendula export planar:2 --as c -o out/c", "a chain of two links as C99"},
    {"export", "pendula export examples/cart_chain.toml --as c --float -o out/c",
     "a scenario, for a processor that has no double"},
    {"models", "pendula models", "what can stand in [system] model = \"...\""},
    {"describe", "pendula describe furuta", "coordinates, parameters, inputs and points, with units"},
    {"new-model", "pendula new-model spring", "writes spring.py, to be changed"},
    {"check", "pendula check --space planar --links 2", "the kernel of planar chains of two links"},
    {"check", "pendula check spring.py", "derive, compile and test a model"},
    {"build", "pendula build spring.py", "derive and compile it beforehand"},
    {"kernels", "pendula kernels", "chains that have one"},
    {"help", "pendula help scenario", "all keys of a scenario, with units and defaults"},
    {"completion", "pendula completion bash > ~/.local/share/bash-completion/completions/pendula",
     "for a pendula that is not installed"},
}};

constexpr std::size_t width = 80;

/// Wraps text into lines that begin at a column; the first one continues `line`.
std::string wrapped(std::string line, std::size_t column, std::string_view text) {
  std::string all;
  if (!line.empty() && line.size() >= column) {
    all = line + '\n';
    line.clear();
  }
  line.resize(column, ' ');
  std::istringstream words{std::string(text)};
  for (std::string word; words >> word;) {
    if (line.size() > column && line.size() + word.size() >= width) {
      all += line + '\n';
      line.assign(column, ' ');
    }
    line += (line.size() > column ? " " : "") + word;
  }
  return all + line + '\n';
}

std::string paragraph(std::string_view title, std::string_view text) {
  return "\n" + std::string(title) + ":\n" + wrapped("", 2, text);
}

/// Names and descriptions, in two columns.
template <class List, class Name, class What>
std::string columns(std::string_view title, const List& list, Name name, What what) {
  constexpr std::size_t widest = 24;
  if (list.empty()) return {};
  std::size_t column = 0;
  for (const auto& one : list) column = std::max(column, name(one).size() + 4);
  std::string text = "\n" + std::string(title) + ":\n";
  for (const auto& one : list) text += wrapped("  " + name(one), std::min(column, widest), what(one));
  return text;
}

/// Keys of the scenario, by table.
std::string key_names(std::string_view command) {
  std::vector<const io::ScenarioTable*> tables = tables_of(command);
  std::erase_if(tables, [](const io::ScenarioTable* table) { return table->name.empty(); });
  return columns(
      "Keys of the scenario that it reads (pendula help scenario tells what they are)", tables,
      [](const io::ScenarioTable* table) { return heading(*table); },
      [](const io::ScenarioTable* table) {
        std::string names;
        for (const io::ScenarioKey& key : table->keys) names.append(key.name).append(" ");
        return names;
      });
}

std::string example_text(std::string_view command) {
  std::string text;
  for (const Example& example : examples_of(command)) {
    text += "  " + std::string(example.call) + "\n      " + std::string(example.what) + '\n';
  }
  return text.empty() ? text : "\nExamples:\n" + text;
}

}  // namespace

std::string version_text() {
  try {
    const std::string needed(needed_instruction_set());
    return "pendula " + std::string(version) + " (" + std::string(instruction_set()) +
           (needed.empty() ? "" : ", on processors with " + needed + " only") + ")";
  } catch (const std::invalid_argument& error) {
    throw io::InputError(error.what());
  }
}

std::vector<Example> examples_of(std::string_view command) {
  std::vector<Example> some;
  if (command == "pendula") {
    for (const std::size_t k : {0U, 2U, 6U, 14U, 17U}) some.push_back(examples[k]);
    return some;
  }
  std::ranges::copy_if(examples, std::back_inserter(some), [&](const Example& one) { return one.command == command; });
  return some;
}

std::string typed(const CLI::Option& option) {
  std::string text;
  for (const std::string& name : option.get_snames()) text += (text.empty() ? "-" : ", -") + name;
  for (const std::string& name : option.get_lnames()) text += (text.empty() ? "--" : ", --") + name;
  if (text.empty()) return option.get_name(true, false);
  const std::string type = option.get_type_name();  // CLI11 adds its checks after a colon
  return option.get_type_size() == 0 ? text : text + ' ' + type.substr(0, type.find(':'));
}

std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) { return option->nonpositional(); });
}

std::vector<const CLI::Option*> arguments_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) { return option->get_positional(); });
}

std::string usage(const CLI::App& command) {
  if (command.get_parent() == nullptr) return "pendula COMMAND [OPTIONS]";
  std::string text = "pendula " + command.get_name() + " [OPTIONS]";
  for (const CLI::Option* option : arguments_of(command)) {
    const std::string name = option->get_name(true, false) + (option->get_expected_max() > 1 ? "..." : "");
    text += option->get_required() ? ' ' + name : " [" + name + ']';
  }
  for (const CLI::Option* option : options_of(command)) {
    if (!option->get_required()) continue;
    const std::vector<std::string>& letters = option->get_snames();
    const std::string name = letters.empty() ? " --" + option->get_lnames().front() : " -" + letters.front();
    text += name + typed(*option).substr(typed(*option).rfind(' '));
  }
  return text;
}

std::string heading(const io::ScenarioTable& table) {
  const io::ScenarioKey* const key = io::find_key(table.name);
  const bool repeats = key != nullptr && key->type == io::KeyType::tables;
  return (repeats ? "[[" : "[") + std::string(table.name) + (repeats ? "]]" : "]");
}

std::vector<const io::ScenarioTable*> tables_of(std::string_view command) {
  std::vector<const io::ScenarioTable*> tables;
  for (const io::ScenarioTable& table : io::scenario_tables()) {
    if (std::ranges::find(table.commands, command) != table.commands.end()) tables.push_back(&table);
  }
  return tables;
}

std::string terms(const io::ScenarioKey& key) {
  std::string text = io::type_text(key);
  if (!key.unit.empty() && key.unit != "1") text += "; " + std::string(key.unit);
  const std::string otherwise = io::default_text(key);
  if (std::holds_alternative<io::Required>(key.otherwise)) return text + "; must be given";
  if (otherwise == "none") return text;
  return text + (otherwise.starts_with("must") ? "; " : "; default: ") + otherwise;
}

std::string help_text(const CommandLine& line, const CLI::App& asked) {
  const bool is_program = asked.get_parent() == nullptr;
  const auto name = [](const CLI::Option* option) { return typed(*option); };
  const auto what = [](const CLI::Option* option) { return option->get_description(); };
  std::string text = wrapped("", 0, asked.get_description()) + "\nUsage: " + usage(asked) + '\n';
  text += columns("Arguments", arguments_of(asked), name, what);
  if (is_program) {
    text += columns(
        "Commands", line.app.get_subcommands([](const CLI::App*) { return true; }),
        [](const CLI::App* command) { return command->get_name(); },
        [](const CLI::App* command) { return command->get_description(); });
  }
  text += columns("Options", options_of(asked), name, what);
  text += key_names(asked.get_name()) + example_text(asked.get_name());
  if (is_program) text += paragraph("Exit status", exit_status) + paragraph("Environment", environment);
  return text;
}

std::string scenario_help() {
  std::string text = wrapped("", 0,
                             "A scenario is a TOML file of these tables. Units are SI, angles rad; a number where an "
                             "array is expected means every link. --set KEY=VALUE replaces a key, as in --set "
                             "run.step=1e-4, --set \"start.theta=90 deg\" or --set chain.masses[2]=3, and --set KEY= "
                             "takes it out.");
  for (const io::ScenarioTable& table : io::scenario_tables()) {
    if (table.name.empty()) continue;
    text += '\n' + wrapped(heading(table), 20, io::find_key(table.name)->hint);
    for (const io::ScenarioKey& key : table.keys) {
      text += wrapped("  " + std::string(key.name), 20, key.hint) + wrapped("", 20, terms(key));
    }
  }
  return text;
}

std::string summary_help() {
  std::string text = wrapped("", 0,
                             "The keys of the JSON object that pendula simulate --json prints. Numbers have the digits "
                             "that give the same double back; what does not apply is null.");
  const auto add = [&](std::string_view title, io::SummaryScope of) {
    text += "\n" + std::string(title) + "\n";
    for (const io::SummaryKey& key : io::summary_keys()) {
      if (key.of != of) continue;
      const std::string unit = key.unit.empty() ? "" : " [" + std::string(key.unit) + "]";
      text += wrapped("  " + std::string(key.name), 22, std::string(key.hint) + unit);
    }
  };
  add("Always", io::SummaryScope::anything);
  add("Of chains", io::SummaryScope::chains);
  add("Of other systems", io::SummaryScope::systems);
  return text;
}

}  // namespace pendula::cli
