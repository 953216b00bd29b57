#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/subject.hpp>
#include <span>
#include <string>
#include <system_error>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "io/errors.hpp"
#include "io/feedback_reader.hpp"
#include "io/generator.hpp"
#include "io/kernel_cache.hpp"
#include "io/kernel_file.hpp"
#include "io/scenario.hpp"
#include "io/toolchain.hpp"

namespace pendula::cli {
namespace {

using Words = std::vector<std::string>;

/// `--key=1,2,3`.
template <class Numbers>
void add_numbers(Words& words, const std::string& key, const Numbers& numbers) {
  std::string text = "--" + key + '=';
  const char* comma = "";
  for (const double number : numbers) {
    text += comma + shortest(number);
    comma = ",";
  }
  words.push_back(text);
}

void add_number(Words& words, const std::string& key, double number) {
  words.push_back("--" + key + '=' + shortest(number));
}

[[noreturn]] void refuse(const std::string& scenario, const std::string& what) {
  throw io::InputError(scenario + ": export: " + what);
}

/// `space:links` as arguments of the generator; nullopt if the text names no chain.
std::optional<Words> chain_words(const std::string& what, const std::optional<int>& links) {
  const std::size_t colon = what.find(':');
  const std::string space = what.substr(0, colon);
  if (space != "planar" && space != "spatial") return std::nullopt;
  const std::string number = colon != std::string::npos ? what.substr(colon + 1) : links ? std::to_string(*links) : "";
  if (number.empty() || number.size() > 4 || number.find_first_not_of("0123456789") != std::string::npos) {
    throw io::InputError("export: expected a chain as " + space + ":3, got " + what);
  }
  return Words{"--space", space, "--links", number};
}

/// A sine that is added to an input, in the words of the generator's feedback.py.
io::InputLaw law_of(const InputSine& sine, const SystemInfo& info) {
  const std::string of_time = shortest(sine.frequency) + " t * " + shortest(sine.phase) + " + sin()";
  return {std::string(info.inputs[static_cast<std::size_t>(sine.input)]),
          of_time + ' ' + shortest(sine.amplitude) + " *"};
}

void add_start(Words& words, const Motion& start) {
  add_numbers(words, "q", start.q);
  add_numbers(words, "v", start.v);
  add_number(words, "time", start.time);
}

/// The laws of a controller, which must all have one sample time.
Words sampled_words(const std::vector<io::FeedbackPlan>& feedback, const Subject& subject) {
  Words words;
  double sample = 0;
  for (const io::FeedbackPlan& plan : feedback) {
    if (plan.sample == 0) continue;
    if (!words.empty() && plan.sample != sample) {
      refuse(plan.place,
             "expected one sample time of all feedback, " + shortest(sample) + ", got " + shortest(plan.sample));
    }
    sample = plan.sample;
    const io::InputLaw law = io::law_in_words(plan, subject);
    words.push_back("--sampled=" + (std::isfinite(plan.limit) ? shortest(plan.limit) : "inf") + '=' + law.input + '=' +
                    law.value);
  }
  return words;
}

template <class Space>
Words scenario_words(const io::Scenario<Space>& scenario, const std::string& file) {
  const Chain<Space>& chain = scenario.chain;
  if (scenario.natural) refuse(file, "chain.units: expected \"SI\", got \"natural\"");
  if (chain.is_held()) {
    refuse(file,
           "chain.end: expected a chain that hangs free, got one whose last bob is held; the model hanging_chain can "
           "be exported");
  }
  Words words = {"--space", Space::dof == 1 ? "planar" : "spatial", "--links", std::to_string(chain.links())};
  const Words sampled = sampled_words(scenario.feedback, ChainSubject<Space>(chain));
  words.insert(words.end(), sampled.begin(), sampled.end());
  std::vector<double> parameters(chain.masses().begin(), chain.masses().end());
  parameters.insert(parameters.end(), chain.lengths().begin(), chain.lengths().end());
  parameters.insert(parameters.end(), chain.damping().begin(), chain.damping().end());
  parameters.push_back(chain.gravity());
  const auto& torque = chain.constant_torque();
  add_numbers(words, "parameters", parameters);
  add_numbers(words, "inputs", std::span(torque.data(), static_cast<std::size_t>(torque.size())));
  add_start(words, scenario.start);
  for (const Drive<Space>& drive : chain.drives()) {
    std::vector<double> numbers{static_cast<double>(drive.link)};
    numbers.insert(numbers.end(), drive.amplitude.begin(), drive.amplitude.end());
    numbers.insert(numbers.end(), {drive.frequency, drive.phase});
    add_numbers(words, "drive", numbers);
  }
  return words;
}

Words scenario_words(const io::SystemScenario& scenario, io::ModelName model, const io::Toolchain& toolchain) {
  const Words sampled = sampled_words(scenario.feedback, *scenario.system);
  const SystemNumbers& numbers = scenario.system->numbers();
  for (const InputSine& sine : numbers.sines) model.laws.push_back(law_of(sine, scenario.system->info()));
  Words words = io::about("export", model, toolchain);
  words.erase(words.begin());
  words.insert(words.end(), sampled.begin(), sampled.end());
  add_numbers(words, "parameters", numbers.parameters);
  add_numbers(words, "inputs", numbers.inputs);
  add_start(words, scenario.start);
  return words;
}

/// Refuses signals: in exports the caller sets inputs.
void refuse_signals(const io::RunPlan& plan) {
  if (plan.signals.empty()) return;
  refuse(
      plan.signals.front().input_place,
      "expected no signal in what is exported, whose inputs are set from step to step, got one; --set system.signal= "
      "(of a chain chain.signal=) leaves it out");
}

/// The sample time; else the constant step; nullopt if there is neither.
std::optional<double> step_of(const io::RunPlan& plan) {
  for (const io::FeedbackPlan& feedback : plan.feedback) {
    if (feedback.sample > 0) return feedback.sample;
  }
  return plan.options.method == Method::gauss && plan.options.step > 0 ? std::optional(plan.options.step)
                                                                       : std::nullopt;
}

/// The tolerance of the steps of an FMU: the accuracy that is asked for, or the tolerance.
double tolerance_of(const io::RunPlan& plan) {
  if (!is_adaptive(plan.options)) return RunOptions{}.tolerance;
  return plan.accuracy.error > 0 ? plan.accuracy.error : plan.options.tolerance;
}

/// Arguments of the generator for the library in an FMU.
Words library_words(const io::Toolchain& toolchain) {
  std::error_code unknown;
  if (!std::filesystem::is_regular_file(toolchain.library, unknown)) {
    throw io::InputError("export: expected pendula's static library, which goes into an FMU, got " +
                         (toolchain.library.empty() ? "none with this program: a build of the repository has it"
                                                    : "no " + toolchain.library.string()) +
                         "; --as c needs none");
  }
  Words words{"--library=" + toolchain.library.string(), "--headers=" + toolchain.headers.string()};
  for (const std::string& flag : io::flags_of_least_set()) words.push_back("--flag=" + flag);
  return words;
}

/// Arguments of the generator for a scenario.
Words scenario_words(const ExportOptions& options, io::Toolchain toolchain) {
  toolchain.kernels_by = "interpreter";  // nothing runs
  std::optional<io::ModelName> model;
  const io::FindSystem find = [&](const io::ModelName& name) {
    model = name;
    return io::find_kernel(name, toolchain, [](const std::string&) {}).table;
  };
  const io::ScenarioText text = io::read_scenario_text(options.what);
  const io::AnyScenario scenario = io::parse_scenario(text.text, text.name, options.overrides, find);
  return std::visit(
      [&](const auto& found) {
        refuse_signals(found);
        Words words;
        if constexpr (requires { found.chain; }) {
          words = scenario_words(found, text.name);
        } else {
          words = scenario_words(found, *model, toolchain);
        }
        if (options.language == "fmu") {
          add_number(words, "tolerance", tolerance_of(found));
          if (found.duration > 0) add_number(words, "duration", found.duration);
        }
        if (!found.events.empty()) std::cerr << "pendula: warning: events are not exported\n";
        const auto is_own = [](const io::ColumnPlan& column) {
          return column.place.find("output.columns") < std::string::npos;
        };
        if (std::ranges::any_of(found.columns, is_own)) std::cerr << "pendula: warning: columns are not exported\n";
        if (const std::optional<double> step = step_of(found)) add_number(words, "step", *step);
        if (found.options.method == Method::gauss && found.options.step > 0 && !options.stages) {
          add_number(words, "stages", found.options.stages);
        }
        return words;
      },
      scenario);
}

/// The default prefix of names.
std::string default_name(const ExportOptions& options) {
  if (options.what.ends_with(".toml")) return std::filesystem::path(options.what).stem().string();
  const std::string stem = std::filesystem::path(options.what).stem().string();
  const std::size_t colon = stem.find(':');
  if (colon != std::string::npos) return stem.substr(0, colon) + '_' + stem.substr(colon + 1);
  return options.links ? stem + '_' + std::to_string(*options.links) : stem;
}

/// Refuses options of another kind of system.
void require_fitting(const ExportOptions& options) {
  const bool is_scenario = options.what.ends_with(".toml");
  if (!is_scenario && !options.overrides.empty()) {
    throw io::InputError("export: --set: expected a scenario (.toml), got " + options.what);
  }
  if (options.stages && options.language == "fmu") {
    throw io::InputError("export: --stages: expected --as c or casadi, got fmu, which chooses its steps");
  }
  if (options.links && (is_scenario || options.what.find(':') != std::string::npos)) {
    throw io::InputError("export: --links: expected a model or the name of a space, got " + options.what);
  }
}

}  // namespace

ExitStatus export_system(const ExportOptions& options) {
  require_fitting(options);
  const io::Toolchain toolchain = io::Toolchain::of_this_program();
  const Words library = options.language == "fmu" ? library_words(toolchain) : Words();
  Words words;
  if (options.what.ends_with(".toml")) {
    words = scenario_words(options, toolchain);
  } else if (std::optional<Words> chain = chain_words(options.what, options.links)) {
    words = *chain;
  } else {
    words = io::about("export", {options.what, options.links}, toolchain);
    words.erase(words.begin());
  }
  words.insert(words.begin(), "export");
  words.insert(words.end(), {"--as", options.language, "--output", options.output, "--name",
                             options.name.empty() ? default_name(options) : options.name});
  if (options.stages) words.insert(words.end(), {"--stages", std::to_string(*options.stages)});
  words.insert(words.end(), library.begin(), library.end());
  if (options.is_float) words.insert(words.end(), {"--number", "float"});
  std::cout << io::run_generator(words, toolchain);
  return done;
}

}  // namespace pendula::cli
