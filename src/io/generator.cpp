#include "io/generator.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <pendula/numeric/number_text.hpp>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/nearest_name.hpp"
#include "io/process.hpp"

namespace pendula::io {

namespace fs = std::filesystem;

namespace {

fs::path models_folder(const Toolchain& toolchain) {
  return toolchain.codegen / "pendula_codegen" / "models";
}

/// Numbers with commas between them.
template <class Numbers>
std::string numbers_text(const Numbers& numbers) {
  std::string text;
  for (const double number : numbers) {
    if (!text.empty()) text += ',';
    text += shortest(number);
  }
  return text;
}

Ended ended_generator(const std::vector<std::string>& arguments, const Toolchain& toolchain) {
  if (toolchain.generate) {
    if (std::optional<Ended> here = toolchain.generate(arguments)) return *std::move(here);
  }
  std::vector<std::string> command = toolchain.module(toolchain.codegen, "pendula_codegen");
  command.insert(command.end(), arguments.begin(), arguments.end());
  return run_process(command, toolchain.ask);
}

}  // namespace

std::string read_model(const fs::path& file) {
  constexpr std::size_t most = std::size_t{16} << 20;
  std::error_code unknown;
  InputFile read{{}, "neither a file nor a link to one"};  // no pipe, since Python reads the file, too
  if (fs::is_regular_file(file, unknown) || !fs::exists(file, unknown)) read = read_input_file(file, most);
  if (read.problem.empty()) return std::move(read.text);
  throw ModelError("expected a model file that can be read, got " + file.string() + ": " + read.problem);
}

fs::path find_model(const ModelName& name, const Toolchain& toolchain) {
  const std::string& model = name.model;
  if (model.ends_with(".py")) return fs::path(model).is_absolute() ? fs::path(model) : name.folder / model;
  const std::vector<std::string> names = built_in_models(toolchain);
  if (std::ranges::find(names, model) != names.end()) return models_folder(toolchain) / (model + ".py");
  std::string text;
  for (const std::string& known : names) text += ", " + known;
  throw ModelError("expected a model file ending in .py, or a built-in model" +
                   (names.empty() ? " (none are installed)" : ": " + text.substr(2)) + "; got " + model +
                   did_you_mean(nearest_name(model, std::vector<std::string_view>(names.begin(), names.end()))));
}

std::string run_generator(const std::vector<std::string>& arguments, const Toolchain& toolchain) {
  const Ended ended = ended_generator(arguments, toolchain);
  if (ended.status == 0) return ended.output;
  // The last such line counts, and only its text: a model may print, too.
  constexpr std::string_view told = "\npendula_codegen: error: ";
  const std::string output = '\n' + ended.output;
  const std::size_t at = output.rfind(told);
  if (ended.status == 2 && at != std::string::npos) {
    const std::size_t begin = at + told.size();
    throw ModelError(output.substr(begin, output.find('\n', begin) - begin));
  }
  const std::string line = last_line(ended.output);
  throw ModelError("models take a Python with the packages of " + (toolchain.codegen / "requirements.txt").string() +
                   ", which " + toolchain.setup().string() + " installs; " + toolchain.python + ": " + line +
                   " (PENDULA_PYTHON names another one)");
}

std::vector<std::string> about(const char* command, const ModelName& name, const Toolchain& toolchain) {
  std::vector<std::string> arguments{command, "--model", find_model(name, toolchain).string()};
  if (name.links) arguments.insert(arguments.end(), {"--links", std::to_string(*name.links)});
  for (const InputLaw& law : name.laws) arguments.push_back("--feedback=" + law.input + "=" + law.value);
  return arguments;
}

std::vector<std::string> built_in_models(const Toolchain& toolchain) {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(models_folder(toolchain), none)) {
    if (entry.path().extension() == ".py" && entry.path().stem() != "__init__") names.push_back(entry.path().stem());
  }
  std::ranges::sort(names);
  return names;
}

std::string describe_model(const ModelName& name, const Toolchain& toolchain) {
  read_model(find_model(name, toolchain));
  return last_line(run_generator(about("describe", name, toolchain), toolchain));
}

std::string describe_models(const Toolchain& toolchain) {
  return last_line(run_generator({"models"}, toolchain));
}

std::vector<double> written_values(const ModelName& name, const Toolchain& toolchain,
                                   std::span<const double> parameters, const Motion& start, unsigned seed) {
  std::vector<std::string> arguments = about("written", name, toolchain);
  const auto add = [&](const char* key, const std::string& value) { arguments.push_back(key + ('=' + value)); };
  add("--parameters", numbers_text(parameters));
  add("--time", shortest(start.time));
  add("--q", numbers_text(start.q));
  add("--v", numbers_text(start.v));
  add("--seed", std::to_string(seed));
  std::istringstream words(last_line(run_generator(arguments, toolchain)));
  std::vector<double> numbers;
  for (std::string word; words >> word;) numbers.push_back(std::strtod(word.c_str(), nullptr));
  return numbers;
}

}  // namespace pendula::io
