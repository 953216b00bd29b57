#include "io/members.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/run.hpp>
#include <string_view>
#include <variant>

#include "io/ensemble_file.hpp"
#include "io/errors.hpp"
#include "io/kernel_cache.hpp"
#include "io/section.hpp"
#include "io/summary.hpp"
#include "io/toml_reader.hpp"

namespace pendula::io {

ScenarioDocument::ScenarioDocument(std::string_view text, std::string_view name, std::span<const std::string> overrides)
    : name_(name), root_(parse_toml(text, name, overrides)), plan_(read_ensemble(Section(root_), name_)) {
  root_.erase("ensemble");
}

bool ScenarioDocument::starts_with_momenta() const {
  constexpr std::string_view prefix = "p_", table = "start.";
  const auto is_momentum = [&](std::string_view key) { return key.starts_with(prefix); };
  const auto is_key_of_momentum = [&](const std::string& key) {
    return key.starts_with(table) && is_momentum(std::string_view(key).substr(table.size()));
  };
  if (std::ranges::any_of(plan_.keys(), is_key_of_momentum)) return true;
  const toml::table* const start = root_["start"].as_table();
  return start != nullptr &&
         std::ranges::any_of(*start, [&](const auto& entry) { return is_momentum(entry.first.str()); });
}

AnyScenario ScenarioDocument::with(std::span<const std::string> overrides, const FindSystem& find) const {
  if (overrides.empty()) return read_document(root_, name_, find);
  toml::table changed = root_;  // a copy knows no lines
  for (const std::string& override : overrides) apply_override(changed, override);
  return read_document(changed, name_, find);
}

AnyScenario ScenarioDocument::with(std::span<const std::string> keys, std::span<const double> numbers,
                                   const FindSystem& find) const {
  toml::table changed = root_;
  for (std::size_t k = 0; k < keys.size(); ++k) set_number(changed, keys[k], numbers[k]);
  return read_document(changed, name_, find);
}

namespace {

/// A message that knows no line of its scenario, with the name of its file.
std::string located(const std::string& told, const std::string& file) {
  constexpr std::string_view nowhere = "scenario:0";
  return told.starts_with(nowhere) ? file + told.substr(nowhere.size()) : told;
}

double& number_at(Motion& start, Eigen::Index place) {
  return place < start.q.size() ? start.q[place] : start.v[place - start.q.size()];
}

/// Whether the start of a member would be read without an error.
bool can_start(const MemberScenario& member) {
  const Motion& start = member.setup.start;
  if (!start.q.allFinite() || !start.v.allFinite()) return false;
  const auto* const other = std::get_if<SystemScenario>(member.scenario.get());
  return other == nullptr || other->system->has_inertia(start.q);
}

}  // namespace

MemberScenario::MemberScenario(AnyScenario read)
    : scenario(std::make_shared<const AnyScenario>(std::move(read))),
      setup(std::visit(
          [](const auto& of) {
            return RunSetup{of, subject_of(of), of.start, false};
          },
          *scenario)) {
  if (setup.rows.chosen && !is_adaptive(setup.options)) setup.every = 10;  // from one look at the energy to the next
  setup.rows = {};
  if (!plan().places.contains("accuracy")) setup.accuracy = {};
  setup.checkpoint = std::numeric_limits<double>::infinity();
}

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
    const std::string told = located(error.what(), text_.name);
    const auto is_of = [&](const std::string& key) {
      return std::string_view(told).substr(override_prefix.size()).starts_with(key + '=');
    };
    if (!told.starts_with(override_prefix) || std::ranges::none_of(plan().keys(), is_of)) throw InputError(told);
    throw InputError(text_.name + ": ensemble: " + told.substr(override_prefix.size()));
  }
}

MemberScenario MemberScenarios::quickly_of_member(std::int64_t member) {
  std::call_once(is_looked_for_, [this] { shared_ = find_shared(); });
  const std::vector<double> numbers = plan().values(member);
  if (shared_) {
    MemberScenario found = shared_->scenario;
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      for (const Eigen::Index place : shared_->places[k]) number_at(found.setup.start, place) = numbers[k];
    }
    if (can_start(found)) return found;
  }
  return MemberScenario(with(numbers));
}

/// Reads two scenarios with different numbers. These have to be found in the start, and nothing else in the start may
/// depend on them.
std::optional<MemberScenarios::Shared> MemberScenarios::find_shared() {
  const std::vector<std::string> keys = plan().keys();
  const auto is_of_start = [](const std::string& key) { return key.starts_with("start."); };
  if (!std::ranges::all_of(keys, is_of_start)) return {};
  // A mass matrix may be 1 at both places that are tried, and another elsewhere.
  if (document_.starts_with_momenta()) return {};
  std::vector<double> one(keys.size()), other(keys.size());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    one[k] = 0.375 + 0.0625 * static_cast<double>(k);
    other[k] = one[k] + 0.125 / static_cast<double>(k + 1);
  }
  try {
    Shared shared{MemberScenario(with(one)), std::vector<std::vector<Eigen::Index>>(keys.size())};
    MemberScenario second(with(other));
    Motion &first = shared.scenario.setup.start, &then = second.setup.start;
    for (Eigen::Index place = 0; place < first.q.size() + first.v.size(); ++place) {
      const double here = number_at(first, place), there = number_at(then, place);
      if (here == there) continue;
      const auto k = static_cast<std::size_t>(std::ranges::find(one, here) - one.begin());
      if (k == one.size() || there != other[k]) return {};
      shared.places[k].push_back(place);
    }
    const auto is_nowhere = [](const std::vector<Eigen::Index>& places) { return places.empty(); };
    if (std::ranges::any_of(shared.places, is_nowhere)) return {};
    return shared;
  } catch (const InputError&) {
    return {};
  }
}

std::shared_ptr<const SystemTable> MemberScenarios::find_system(const ModelName& name) {
  const std::scoped_lock lock(guard_);
  std::shared_ptr<const SystemTable>& found = systems_[name];
  if (found) return found;
  model_ = model_source(name, toolchain_);
  found = find_kernel(name, toolchain_, tell_).table;
  return found;
}

MemberRuns::MemberRuns(MemberScenarios& scenarios, const KeptQuantities& kept, std::function<bool()> stop)
    : scenarios_(scenarios),
      plan_(scenarios.plan()),
      kept_(kept),
      stop_(std::move(stop)),
      width_(kept.columns().size() + EnsembleHead::flags) {}

/// A member, its scenario and its report.
struct MemberRuns::Member {
  std::optional<MemberScenario> scenario;  // empty if it cannot be read
  std::string problem;
  std::optional<RunReport> report;           // empty until the members in lanes are moved
  std::optional<LyapunovSpectrum> exponent;  // if it is kept, and was found in lanes
};

DoneChunk MemberRuns::run(const Chunk& members) const {
  std::vector<Member> all;
  std::vector<RunSetup> in_lanes;
  SharedExpressions shared;
  for (std::int64_t number = members.first; number < members.last; ++number) {
    const Member& last = all.emplace_back(member(number, shared));
    if (last.scenario && !last.report) in_lanes.push_back(last.scenario->setup);
  }
  std::vector<RunReport> reports = run_members(in_lanes, stop_);
  if (kept_.chaos()) find_exponents(all);
  auto next = reports.begin();
  DoneChunk done;
  done.members = members;
  done.rows.reserve(static_cast<std::size_t>(members.size()) * width_);
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (all[k].scenario && !all[k].report) all[k].report = std::move(*next++);
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
    return member_of(MemberScenario(scenarios_.of_member(number)), number, shared);
  } catch (const InputError& error) {
    Member unreadable;
    unreadable.problem = located(error.what(), scenarios_.text().name);
    return unreadable;
  }
}

MemberRuns::Member MemberRuns::member_of(MemberScenario scenario, std::int64_t number,
                                         SharedExpressions& shared) const {
  Member member;
  RunSetup& setup = member.scenario.emplace(std::move(scenario)).setup;
  setup.chooses_method |= plan_.chooses_method;
  setup.events = events_of(member.scenario->plan().events, setup.subject, setup.start, shared);
  // Trials for an accuracy say of each member how far it can be trusted.
  setup.judged = setup.estimate && (setup.accuracy.error > 0 || is_looked_at(number));
  if (!lane_kind(setup, lane_options(setup))) {
    Run alone = told_at_keys(member.scenario->plan(), scenarios_.text().name, [&] { return Run(setup); });
    member.report = alone.go(stop_);
  }
  return member;
}

// Exponents of the members that run in lanes with a tangent. Not for Gauss methods without ensemble.method = "auto":
// the exponents are those of `pendula lyapunov` then, whose tangents begin otherwise than those in lanes.
void MemberRuns::find_exponents(std::vector<Member>& all) const {
  std::vector<RunSetup> setups;
  std::vector<Member*> members;
  for (Member& member : all) {
    if (!member.scenario) continue;
    RunSetup setup = member.scenario->setup;
    setup.chooses_method = plan_.chooses_method;
    setup.events.clear();
    setup.judged = false;
    if (!setup.chooses_method && !is_explicit(setup.options.method)) continue;
    setups.push_back(std::move(setup));
    members.push_back(&member);
  }
  std::vector<std::optional<LyapunovSpectrum>> found = exponents_in_lanes(setups, stop_);
  if (found.size() < members.size()) throw Interrupted();
  for (std::size_t k = 0; k < members.size(); ++k) members[k]->exponent = std::move(found[k]);
}

// Appends the row of a member. Returns its message, or an empty one.
std::string MemberRuns::append(const Member& member, std::vector<double>& rows) const {
  const std::size_t begin = rows.size();
  const auto add = [&](const MemberScenario& scenario) {
    const RunReport& report = *member.report;
    const Subject& subject = *scenario.setup.subject;
    if (report.end == RunEnd::stopped) throw Interrupted();
    std::vector<std::string> events;
    events.reserve(scenario.plan().events.size());
    for (const EventPlan& event : scenario.plan().events) events.push_back(event.name);
    const Ending ending = ending_of(report, subject.coordinates(), events, subject.switches());
    LyapunovSpectrum spectrum;
    if (kept_.chaos()) spectrum = member.exponent ? *member.exponent : leading_exponent(scenario);
    const int status = member_status(ending.status);
    const auto trusted = static_cast<double>(report.warnings.empty() ? Trusted::yes : Trusted::no);
    rows.push_back(status);
    rows.push_back(scenario.setup.judged && is_ok(status) ? trusted : std::nan(""));
    kept_.append(subject, report, spectrum, rows);
    return ending.message;
  };
  std::string problem = member.problem;
  try {
    if (member.scenario) return add(*member.scenario);
  } catch (const InputError& error) {
    problem = error.what();
  }
  rows.resize(begin);
  rows.push_back(member_status("wrong_input"));
  rows.resize(begin + width_, std::nan(""));
  return problem;
}

LyapunovSpectrum MemberRuns::leading_exponent(const MemberScenario& scenario) const {
  const RunPlan& plan = scenario.plan();
  LyapunovRun found = told_at_keys(plan, scenarios_.text().name, [&] {
    const auto integrator = scenario.setup.subject->make_integrator(plan.options);
    return find_lyapunov_spectrum(
        *integrator, scenario.setup.start, longest_step(plan.options), plan.duration, 1, [](const LyapunovProgress&) {},
        stop_);
  });
  if (found.result.stopped) throw Interrupted();
  return found;
}

}  // namespace pendula::io
