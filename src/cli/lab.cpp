#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "io/generator.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/scenario.hpp"
#include "io/toolchain.hpp"
#include "io/whole_file.hpp"
#include "view/lab.hpp"

namespace pendula::cli {
namespace {

using nlohmann::json;

void warn(const std::string& what) {
  std::cerr << "pendula: warning: the laboratory leaves out " << what << '\n';
}

/// A chain and its start as a link.
template <class Space>
std::string link_of(const io::Scenario<Space>& scenario) {
  const Chain<Space>& chain = scenario.chain;
  if (!scenario.feedback.empty()) warn("feedback");
  if (scenario.natural) warn("natural units: it shows the numbers of the scenario as SI");
  for (const std::string& what : view::lab_leaves_out(chain)) warn(what);
  view::LabLink link = view::lab_link(chain);
  const auto& start = scenario.start;
  link.put("th", start.theta());
  link.put("w", start.theta_dot());
  if constexpr (Space::dof == 2) {
    link.put("ph", start.q.tail(chain.links()));
    link.put("wp", start.v.tail(chain.links()));
  }
  return link.text();
}

/// What a page is told of a model: its program, and what describe tells.
json model_start(const io::ModelName& name, const io::Toolchain& toolchain) {
  const json described = json::parse(io::describe_model(name, toolchain));
  return {{"title", described["model"]}, {"model", described}, {"program", io::model_program(name, toolchain)}};
}

json scenario_start(const LabOptions& options, const io::Toolchain& toolchain) {
  std::optional<io::ModelName> model;
  const io::FindSystem find = [&](const io::ModelName& name) {
    model = name;
    return io::find_kernel(name, toolchain, [](const std::string&) {}).table;
  };
  const io::ScenarioText text = io::read_scenario_text(options.scenario);
  const io::AnyScenario scenario = io::parse_scenario(text.text, text.name, options.overrides, find);
  const std::string title = std::filesystem::path(text.name).stem().string();
  return std::visit(
      [&](const auto& found) -> json {
        if constexpr (requires { found.chain; }) {
          return {{"title", title}, {"state", link_of(found)}};
        } else {
          model->laws.clear();
          if (!found.feedback.empty() || !found.system->numbers().sines.empty()) warn("drives and feedback");
          json start = model_start(*model, toolchain);
          view::LabLink link;
          const std::vector<double>& all = found.system->numbers().parameters;
          link.put("p", std::span(all).first(all.size() - 2 * found.system->info().switches.size()));
          link.put("q", found.start.q);
          link.put("v", found.start.v);
          start["title"] = title;
          start["state"] = link.text();
          return start;
        }
      },
      scenario);
}

}  // namespace

ExitStatus lab(const LabOptions& options) {
  if (!view::has_lab()) {
    throw io::InputError(
        "this build has no laboratory: it takes emscripten, which scripts/setup --web installs; then configure again");
  }
  io::WholeFile page(options.output);
  io::Toolchain toolchain = io::Toolchain::of_this_program();
  toolchain.kernels_by = "interpreter";  // as in the page
  json start = json::object();
  const bool is_scenario = options.scenario == "-" || options.scenario.ends_with(".toml");
  if (!is_scenario && !options.scenario.empty()) {
    start = model_start({options.scenario, options.links}, toolchain);
  } else if (is_scenario) {
    start = scenario_start(options, toolchain);
  }
  page.write(view::lab_page(start));
  return done;
}

}  // namespace pendula::cli
