#include "cli/members.hpp"

#include <cmath>
#include <iostream>
#include <limits>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/run.hpp>
#include <variant>

#include "cli/scenario_subject.hpp"
#include "io/ensemble_file.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/summary.hpp"

namespace pendula::cli {
namespace {

template <class Scenario>
RunSetup setup_of(const Scenario& scenario) {
  const std::shared_ptr<const Subject> subject = subject_of(scenario);
  return {.subject = subject,
          .start = scenario.start,
          .options = scenario.run,
          .duration = scenario.duration,
          .every = scenario.every,
          .doubted = false,
          .events = io::events_of(scenario.events, subject, scenario.start)};
}

std::vector<std::string> names_of(const std::vector<Event>& events) {
  std::vector<std::string> names;
  names.reserve(events.size());
  for (const Event& event : events) names.push_back(event.name);
  return names;
}

}  // namespace

MemberScenarios::MemberScenarios(const std::string& file, std::vector<std::string> overrides, bool quiet)
    : text_(io::read_scenario_text(file)), overrides_(std::move(overrides)), quiet_(quiet) {}

io::AnyScenario MemberScenarios::of_member(const io::EnsemblePlan& plan, std::int64_t member) {
  std::vector<std::string> overrides = overrides_;
  for (std::string& change : plan.overrides(member)) overrides.push_back(std::move(change));
  return parse(overrides);
}

io::AnyScenario MemberScenarios::parse(const std::vector<std::string>& overrides) {
  const io::FindSystem find = [this](const std::string& name, std::optional<int> links,
                                     const std::filesystem::path& folder) { return find_system(name, links, folder); };
  return io::parse_scenario(text_.text, text_.name, overrides, find);
}

std::shared_ptr<const SystemEntry> MemberScenarios::find_system(const std::string& name, std::optional<int> links,
                                                                const std::filesystem::path& folder) {
  const std::scoped_lock lock(guard_);
  std::shared_ptr<const SystemEntry>& found = systems_[{name, links.value_or(0)}];
  if (found) return found;
  const io::Toolchain toolchain = io::Toolchain::of_this_program();
  model_ = io::model_source(name, links, folder, toolchain);
  const auto say = [&](const std::string& what) {
    if (!quiet_) std::cerr << "pendula: " << what << '\n';
  };
  found = io::find_kernel(name, links, folder, toolchain, say).entry;
  return found;
}

MemberRuns::MemberRuns(MemberScenarios& scenarios, const io::EnsemblePlan& plan, const Kept& kept,
                       const InterruptGuard& guard)
    : scenarios_(scenarios), plan_(plan), kept_(kept), guard_(guard), width_(kept.columns().size() + 1) {}

io::DoneChunk MemberRuns::run(const Chunk& members) const {
  io::DoneChunk done;
  done.members = members;
  done.rows.reserve(static_cast<std::size_t>(members.size()) * width_);
  for (std::int64_t member = members.first; member < members.last; ++member) {
    const std::string message = run(member, done.rows);
    if (!message.empty()) done.messages.push_back({member, message});
  }
  return done;
}

std::vector<std::string> MemberRuns::doubts(std::int64_t member) const {
  try {
    RunSetup setup =
        std::visit([](const auto& scenario) { return setup_of(scenario); }, scenarios_.of_member(plan_, member));
    setup.doubted = true;
    return Run(std::move(setup)).go([&] { return guard_.interrupted(); }).warnings;
  } catch (const io::InputError&) {
    return {};
  }
}

// Appends the row of a member; gives what there is to say.
std::string MemberRuns::run(std::int64_t member, std::vector<double>& rows) const {
  const std::size_t begin = rows.size();
  try {
    return std::visit([&](const auto& scenario) { return run(scenario, rows); }, scenarios_.of_member(plan_, member));
  } catch (const io::InputError& error) {
    rows.resize(begin);
    rows.push_back(io::member_status("wrong_input"));
    rows.resize(begin + width_, std::nan(""));
    return error.what();
  }
}

template <class Scenario>
std::string MemberRuns::run(const Scenario& scenario, std::vector<double>& rows) const {
  RunSetup setup = setup_of(scenario);
  const std::shared_ptr<const Subject> subject = setup.subject;
  const std::vector<std::string> events = names_of(setup.events);
  Run one = told_at_keys(scenario, scenarios_.text().name, [&] { return Run(std::move(setup)); });
  const RunReport report = one.go([&] { return guard_.interrupted(); });
  if (report.end == RunEnd::stopped) throw Interrupted();
  const io::Ending ending = io::ending_of(report, subject->coordinates(), events);
  const auto [exponent, error] = kept_.lyapunov() ? leading_exponent(scenario) : std::pair(0.0, 0.0);
  rows.push_back(io::member_status(ending.status));
  kept_.append(*subject, report, exponent, error, rows);
  return ending.message;
}

template <class Scenario>
std::pair<double, double> MemberRuns::leading_exponent(const Scenario& scenario) const {
  const double step = is_adaptive(scenario.run) ? std::numeric_limits<double>::infinity() : scenario.run.step;
  const LyapunovSpectrum found = told_at_keys(scenario, scenarios_.text().name, [&] {
    const auto integrator = subject_of(scenario)->make_integrator(scenario.run);
    return find_lyapunov_spectrum(
        *integrator, scenario.start, step, scenario.duration, 1, [](const LyapunovProgress&) {},
        [&] { return guard_.interrupted(); });
  });
  if (found.result.stopped) throw Interrupted();
  return {found.exponents[0], found.errors[0]};
}

}  // namespace pendula::cli
