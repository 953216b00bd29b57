#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <string>
#include <variant>

#include "cli/commands.hpp"
#include "cli/output_files.hpp"
#include "cli/usual_start.hpp"
#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/kernel_cache.hpp"
#include "io/scenario.hpp"
#include "io/toolchain.hpp"
#include "view/lab.hpp"
#include "view/scenario_scene.hpp"

namespace pendula::cli {
namespace {

using nlohmann::json;

template <class Scenario>
void warn(const Scenario& scenario) {
  for (const std::string& what : view::laboratory_leaves_out(scenario)) {
    std::cerr << "pendula: warning: the laboratory leaves out " << what << '\n';
  }
}

/// A chain and its start as a link.
template <class Space>
std::string link_of(const io::Scenario<Space>& scenario) {
  const Chain<Space>& chain = scenario.chain;
  warn(scenario);
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

void no_words(const std::string&) {}

/// The start of a page for a model.
json model_start(const io::ModelName& name, const SystemInfo& info, const io::Toolchain& toolchain) {
  json start = view::lab_model(info, io::kernel_program(name, toolchain, no_words));
  start["title"] = info.model;
  return start;
}

/// The same for a model and its start in a scenario.
json start_of(const io::SystemScenario& scenario, const io::ModelName& name, const io::Toolchain& toolchain) {
  warn(scenario);
  json start = model_start(name, scenario.system->info(), toolchain);
  view::LabLink link = view::lab_link(*scenario.system);
  link.put("q", scenario.start.q);
  link.put("v", scenario.start.v);
  start["state"] = link.text();
  return start;
}

/// A linkage that is put together, as a link.
std::string closed_state(const std::shared_ptr<const SystemTable>& kernel) {
  const SystemSubject system(kernel, usual_numbers(kernel->info));
  const Motion start = usual_start(system, "lab");
  view::LabLink link = view::lab_link(system);
  link.put("q", start.q);
  link.put("v", start.v);
  return link.text();
}

json scenario_start(const LabOptions& options, const io::Toolchain& toolchain) {
  std::optional<io::ModelName> model;
  const io::FindSystem find = [&](const io::ModelName& name) {
    model = name;
    return io::find_kernel(name, toolchain, no_words).table;
  };
  const io::ScenarioText text = io::read_scenario_text(options.scenario);
  const io::AnyScenario scenario = io::parse_scenario(text.text, text.name, options.overrides, find);
  json start = std::visit(
      [&](const auto& found) -> json {
        if constexpr (requires { found.chain; }) {
          return {{"state", link_of(found)}};
        } else {
          return start_of(found, *model, toolchain);
        }
      },
      scenario);
  start["title"] = std::filesystem::path(text.name).stem().string();
  return start;
}

}  // namespace

ExitStatus lab(const LabOptions& options) {
  require_page(options.output);
  io::WholeFile page(options.output);
  io::Toolchain toolchain = io::Toolchain::of_this_program();
  toolchain.kernels_by = "interpreter";  // as in the page
  json start = json::object();
  const bool is_scenario = options.scenario == "-" || options.scenario.ends_with(".toml");
  if (!is_scenario && !options.scenario.empty()) {
    const io::ModelName name{options.scenario, options.links};
    const auto kernel = io::find_kernel(name, toolchain, no_words).table;
    start = model_start(name, kernel->info, toolchain);
    if (!kernel->info.constraints.empty()) start["state"] = closed_state(kernel);
  } else if (is_scenario) {
    start = scenario_start(options, toolchain);
  }
  page.write(view::lab_page(start));
  return done;
}

}  // namespace pendula::cli
