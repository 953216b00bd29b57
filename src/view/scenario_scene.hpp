#pragma once

#include <algorithm>
#include <filesystem>
#include <pendula/run/chain_subject.hpp>
#include <pendula/version.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/natural_units.hpp"
#include "io/run_source.hpp"
#include "io/scenario.hpp"
#include "io/scenario_run.hpp"
#include "view/lab.hpp"
#include "view/scene.hpp"

namespace pendula::view {

namespace detail {

/// The scene of a scenario without its feedback, which is not drawn.
template <class Space>
Scene drawn_scene(const io::Scenario<Space>& scenario) {
  return scene_of(ChainSubject<Space>(scenario.chain));
}
inline Scene drawn_scene(const io::SystemScenario& scenario) {
  return scene_of(*scenario.system);
}

}  // namespace detail

/// The description of a scenario's subject for a page. Its rows are those of the subject with feedback, which adds
/// columns of torques to a chain.
template <class Scenario>
Scene subject_scene(const Scenario& scenario) {
  Scene scene = detail::drawn_scene(scenario);
  const auto subject = io::subject_of(scenario);
  scene.columns = subject->columns();
  scene.loaded = subject->loaded();
  return scene;
}

/// Parts of a scenario that a laboratory leaves out or changes, in words. Continuous feedback is part of a model's
/// program.
template <class Scenario>
std::vector<std::string> laboratory_leaves_out(const Scenario& scenario) {
  std::vector<std::string> words;
  if (!scenario.signals.empty()) words.emplace_back("signals");
  if constexpr (requires { scenario.chain; }) {
    if (!scenario.feedback.empty()) words.emplace_back("feedback");
    if (scenario.natural) words.emplace_back("natural units: it shows the numbers of the scenario as SI");
    for (std::string& what : lab_leaves_out(scenario.chain)) words.push_back(std::move(what));
  } else {
    const auto is_sampled = [](const io::FeedbackPlan& plan) { return plan.sample > 0; };
    if (std::ranges::any_of(scenario.feedback, is_sampled)) words.emplace_back("sampled feedback");
  }
  return words;
}

/// The laboratory's link of a scenario's subject, in SI; empty if the laboratory would leave something out.
template <class Scenario>
std::string laboratory_of(const Scenario& scenario) {
  if (!laboratory_leaves_out(scenario).empty()) return {};
  if constexpr (requires { scenario.chain; }) {
    return lab_link(scenario.chain).text();
  } else {
    return lab_link(*scenario.system).text();
  }
}

/// The description of a run for a page, besides its rows.
template <class Scenario>
Scene scene_of(const Scenario& scenario, const io::RunSource& source) {
  Scene scene = subject_scene(scenario);
  scene.title = std::filesystem::path(source.text.name).stem().string();
  scene.scenario = source.text.text;
  for (const std::string& change : source.overrides) scene.scenario += "# run with --set " + change + '\n';
  scene.version = version;
  scene.time_unit = io::in_units(scenario.natural, "s");
  scene.length_unit = io::in_units(scenario.natural, "m");
  return scene;
}

}  // namespace pendula::view
