#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/motion.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/errors.hpp"
#include "io/event_reader.hpp"
#include "io/run_arrays.hpp"
#include "io/scenario.hpp"
#include "io/summary.hpp"

/// From scenarios to runs, and from their reports to summaries.
namespace pendula::io {

/// With what acts on its inputs besides drives, and with own columns.
inline std::shared_ptr<const Subject> with_plan(const RunPlan& plan, const std::shared_ptr<const Subject>& subject) {
  const auto fed = with_feedback(subject, sampled_laws(plan.feedback, subject), signals_of(plan.signals, *subject));
  return with_columns(fed, own_columns(plan.columns, *fed));
}

/// The subject of a scenario.
template <class Space>
std::shared_ptr<const Subject> subject_of(const Scenario<Space>& scenario) {
  return with_plan(scenario, std::make_shared<ChainSubject<Space>>(scenario.chain));
}
inline std::shared_ptr<const Subject> subject_of(const SystemScenario& scenario) {
  return with_plan(scenario, scenario.system);
}

/// The run that a scenario asks for. Throws InputError if its events cannot be read.
template <class ScenarioType>
RunSetup setup_of(const ScenarioType& scenario) {
  const std::shared_ptr<const Subject> subject = subject_of(scenario);
  RunSetup setup{scenario, subject, scenario.start};
  setup.events = events_of(scenario.events, subject, scenario.start);
  return setup;
}

/// The names of the events that a run looks for.
inline std::vector<std::string> event_names(const RunSetup& setup) {
  std::vector<std::string> names;
  names.reserve(setup.events.size());
  for (const Event& event : setup.events) names.push_back(event.name);
  return names;
}

/// The contents of a run file; with events if `with_events`.
inline RunContents contents_of(const RunSetup& setup, const RunPlan& plan, bool with_events = true) {
  return {setup.subject->quantities(), setup.subject->constants(),
          with_events ? event_names(setup) : std::vector<std::string>(), plan.natural};
}

/// Calls act(). Errors of the runtime about an option, `key: …`, become InputError with the place of that key.
template <class Do>
auto told_at_keys(const RunPlan& plan, const std::string& file, Do act) {
  try {
    return act();
  } catch (const NoKernel& error) {
    throw InputError(plan.places.at("links") + ": " + error.what());
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    const std::size_t colon = std::min(what.find(':'), what.size());
    const auto place = plan.places.find(what.substr(0, colon));
    throw InputError(place == plan.places.end() ? file + ": " + what : place->second + what.substr(colon));
  }
}

/// Adds to a summary, which has the report of a run, what was asked for and how the run ended.
inline void describe(const RunSetup& setup, Summary& summary) {
  summary.asked = setup;
  summary.event_names = event_names(setup);
  summary.ending = ending_of(summary, setup.subject->coordinates(), summary.event_names, setup.subject->switches());
}

/// The inputs of several plans, each once.
template <class Plan>
std::vector<std::string> inputs_of(const std::vector<Plan>& plans) {
  std::vector<std::string> inputs;
  for (const Plan& plan : plans) {
    if (std::ranges::find(inputs, plan.input) == inputs.end()) inputs.push_back(plan.input);
  }
  return inputs;
}

/// Adds which inputs have feedback and signals.
inline void describe_acting(const RunPlan& plan, ModelSummary& model) {
  model.feedback = inputs_of(plan.feedback);
  model.signals = inputs_of(plan.signals);
  model.loaded = model.loaded || !model.feedback.empty() || !model.signals.empty();
}

/// Adds what moved, by a scenario in `file`, and its last state.
template <class Space>
void describe(const Scenario<Space>& scenario, const std::string& file, Summary& summary) {
  summary.model = model_summary(file, scenario.chain, scenario.natural);
  summary.model.closed_by = scenario.closed_by;
  summary.model.hangs = scenario.hangs;
  describe_acting(scenario, summary.model);
  summary.final = snapshot(scenario.chain, summary.last);
}
inline void describe(const SystemScenario& scenario, const std::string& file, Summary& summary) {
  summary.model = model_summary(file, *scenario.system);
  summary.model.assembled = scenario.assembled;
  summary.model.guesses = scenario.guesses;
  summary.model.degrees_of_freedom -= scenario.constraints;
  describe_acting(scenario, summary.model);
  summary.system = snapshot(*scenario.system, summary.last);
}

}  // namespace pendula::io
