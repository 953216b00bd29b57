#include "io/members.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/run.hpp>
#include <string_view>
#include <variant>

#include "io/ensemble_file.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/summary.hpp"

namespace pendula::io {

MemberScenarios::MemberScenarios(ScenarioText text, std::vector<std::string> overrides, Toolchain toolchain, Tell tell)
    : text_(std::move(text)),
      overrides_(std::move(overrides)),
      document_(text_.text, text_.name, overrides_),
      toolchain_(std::move(toolchain)),
      tell_(std::move(tell)) {}

AnyScenario MemberScenarios::of_member(std::int64_t member) {
  try {
    return document_.with(plan().overrides(member), find());
  } catch (const InputError& error) {
    // The members' numbers are overrides, too; messages must not call them --set.
    const std::string_view told = error.what();
    const auto is_of = [&](const std::string& key) {
      return told.substr(override_prefix.size()).starts_with(key + '=');
    };
    if (!told.starts_with(override_prefix) || std::ranges::none_of(plan().keys(), is_of)) throw;
    throw InputError(text_.name + ": ensemble: " + std::string(told.substr(override_prefix.size())));
  }
}

AnyScenario MemberScenarios::quickly_of_member(std::int64_t member) {
  return document_.with(plan().keys(), plan().values(member), find());
}

std::shared_ptr<const SystemTable> MemberScenarios::find_system(const ModelName& name) {
  const std::scoped_lock lock(guard_);
  std::shared_ptr<const SystemTable>& found = systems_[name];
  if (found) return found;
  model_ = model_source(name, toolchain_);
  found = find_kernel(name, toolchain_, tell_).table;
  return found;
}

MemberRuns::MemberRuns(MemberScenarios& scenarios, const Kept& kept, std::function<bool()> stop)
    : scenarios_(scenarios),
      plan_(scenarios.plan()),
      kept_(kept),
      stop_(std::move(stop)),
      width_(kept.columns().size() + EnsembleHead::flags) {}

/// A member, its scenario and its report.
struct MemberRuns::Member {
  std::optional<AnyScenario> scenario;  // empty if it cannot be read
  std::string problem;
  std::optional<RunSetup> setup;  // of a member that is run together with others
  RunReport report;
  bool is_looked_at = false;
  std::optional<LyapunovSpectrum> exponent;  // if it is kept, and was found in lanes
};

DoneChunk MemberRuns::run(const Chunk& members) const {
  std::vector<Member> all;
  std::vector<RunSetup> waiting;
  SharedExpressions shared;
  for (std::int64_t number = members.first; number < members.last; ++number) {
    all.push_back(member(number, shared));
    if (all.back().setup) waiting.push_back(*all.back().setup);
  }
  std::vector<RunReport> reports = run_members(waiting, stop_, method());
  if (kept_.chaos()) find_exponents(all);
  auto next = reports.begin();
  DoneChunk done;
  done.members = members;
  done.rows.reserve(static_cast<std::size_t>(members.size()) * width_);
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (all[k].setup) all[k].report = std::move(*next++);
    const std::string message = append(all[k], done.rows);
    if (!message.empty()) done.messages.push_back({members.first + static_cast<std::int64_t>(k), message});
  }
  if (stop_()) throw Interrupted();  // an interrupted second look would raise false doubts
  return done;
}

// All members of a small ensemble; of a large one some groups that fill lanes, spread evenly by multiples of the golden
// ratio.
bool MemberRuns::is_looked_at(std::int64_t number) const {
  constexpr std::uint64_t few = 256, one_of = 32, together = 8, golden = 0x9E3779B97F4A7C15;
  const auto count = static_cast<std::uint64_t>(plan_.count), wanted = std::max(few, count / one_of);
  const std::uint64_t share = std::numeric_limits<std::uint64_t>::max() / count;
  return count <= few || static_cast<std::uint64_t>(number) / together * golden < share * wanted;
}

// Reads a member, and runs it unless it can run in lanes. A wrong member is read again with places, for the message.
MemberRuns::Member MemberRuns::member(std::int64_t number, SharedExpressions& shared) const {
  try {
    return member_of(scenarios_.quickly_of_member(number), number, shared);
  } catch (const InputError&) {
  }
  try {
    return member_of(scenarios_.of_member(number), number, shared);
  } catch (const InputError& error) {
    Member unreadable;
    unreadable.problem = error.what();
    return unreadable;
  }
}

MemberRuns::Member MemberRuns::member_of(AnyScenario scenario, std::int64_t number, SharedExpressions& shared) const {
  Member member;
  member.scenario = std::move(scenario);
  RunSetup setup = setup_of(*member.scenario, shared);
  // Trials for an accuracy say of each member how far it can be trusted.
  setup.doubted = setup.estimate && (setup.accuracy.error > 0 || is_looked_at(number));
  member.is_looked_at = setup.doubted;
  if (lane_kind(setup, lane_options(setup, method()))) {
    member.setup = std::move(setup);
  } else {
    member.report = std::visit([&](const auto& read) { return run_alone(read, std::move(setup)); }, *member.scenario);
  }
  return member;
}

RunSetup MemberRuns::setup_of(const AnyScenario& scenario, SharedExpressions& shared) const {
  RunSetup setup = std::visit(
      [&](const auto& read) {
        RunSetup found = member_setup(read);
        found.events = events_of(read.events, found.subject, read.start, shared);
        return found;
      },
      scenario);
  return setup;
}

// Exponents of the members that run in lanes with a tangent. Not for Gauss methods with method = "run": the exponents
// are those of `pendula lyapunov` then, whose tangents begin otherwise than those in lanes.
void MemberRuns::find_exponents(std::vector<Member>& all) const {
  std::vector<RunSetup> setups;
  std::vector<Member*> members;
  for (Member& member : all) {
    if (!member.scenario) continue;
    RunSetup setup = std::visit([](const auto& read) { return member_setup(read); }, *member.scenario);
    if (method() == MemberMethod::asked && !is_explicit(setup.options.method)) continue;
    setups.push_back(std::move(setup));
    members.push_back(&member);
  }
  std::vector<std::optional<LyapunovSpectrum>> found = exponents_in_lanes(setups, stop_, method());
  if (found.size() < members.size()) throw Interrupted();
  for (std::size_t k = 0; k < members.size(); ++k) members[k]->exponent = std::move(found[k]);
}

template <class Scenario>
RunReport MemberRuns::run_alone(const Scenario& scenario, RunSetup setup) const {
  Run one = told_at_keys(scenario, scenarios_.text().name, [&] { return Run(std::move(setup)); });
  return one.go(stop_);
}

// Appends the row of a member. Returns its message, or an empty one.
std::string MemberRuns::append(const Member& member, std::vector<double>& rows) const {
  const std::size_t begin = rows.size();
  const auto add = [&](const auto& scenario) {
    const RunReport& report = member.report;
    if (report.end == RunEnd::stopped) throw Interrupted();
    const std::shared_ptr<const Subject> subject = subject_of(scenario);
    std::vector<std::string> events;
    events.reserve(scenario.events.size());
    for (const EventPlan& event : scenario.events) events.push_back(event.name);
    const Ending ending = ending_of(report, subject->coordinates(), events);
    LyapunovSpectrum spectrum;
    if (kept_.chaos()) spectrum = member.exponent ? *member.exponent : leading_exponent(scenario);
    const int status = member_status(ending.status);
    const auto trusted = static_cast<double>(report.warnings.empty() ? Trusted::yes : Trusted::no);
    rows.push_back(status);
    rows.push_back(member.is_looked_at && is_ok(status) ? trusted : std::nan(""));
    kept_.append(*subject, report, spectrum, rows);
    return ending.message;
  };
  std::string problem = member.problem;
  try {
    if (member.scenario) return std::visit(add, *member.scenario);
  } catch (const InputError& error) {
    problem = error.what();
  }
  rows.resize(begin);
  rows.push_back(member_status("wrong_input"));
  rows.resize(begin + width_, std::nan(""));
  return problem;
}

template <class Scenario>
LyapunovSpectrum MemberRuns::leading_exponent(const Scenario& scenario) const {
  const double step = is_adaptive(scenario.run) ? std::numeric_limits<double>::infinity() : scenario.run.step;
  LyapunovRun found = told_at_keys(scenario, scenarios_.text().name, [&] {
    const auto integrator = subject_of(scenario)->make_integrator(scenario.run);
    return find_lyapunov_spectrum(
        *integrator, scenario.start, step, scenario.duration, 1, [](const LyapunovProgress&) {}, stop_);
  });
  if (found.result.stopped) throw Interrupted();
  return found;
}

}  // namespace pendula::io
