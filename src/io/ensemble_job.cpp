#include "io/ensemble_job.hpp"

#include <algorithm>
#include <filesystem>
#include <pendula/run/library.hpp>
#include <pendula/run/trust.hpp>
#include <pendula/version.hpp>
#include <utility>
#include <variant>

#include "io/errors.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

/// Members in a chunk. It depends on the ensemble alone, so that a resumed one has the same; a few for each lane.
std::int64_t chunk_of(std::int64_t members, bool in_lanes) {
  return std::clamp<std::int64_t>(members / 128, in_lanes ? 32 : 1, 512);
}

KeptQuantities kept_of(const AnyScenario& any, const EnsemblePlan& plan) {
  return std::visit([&](const auto& scenario) { return KeptQuantities(plan, *subject_of(scenario), scenario.events); },
                    any);
}

std::optional<NaturalUnits> natural_units_of(const AnyScenario& any) {
  return std::visit([](const auto& scenario) { return scenario.natural; }, any);
}

}  // namespace

EnsembleJob::EnsembleJob(const EnsembleSource& source, MemberScenarios::Tell tell, std::function<bool()> stop)
    : scenarios_(source.scenario, source.overrides, source.toolchain, std::move(tell)),
      base_(scenarios_.base()),
      kept_(kept_of(base_, scenarios_.plan())),
      head_{origin(source.command), scenarios_.plan(), kept_.columns(),
            chunk_of(scenarios_.plan().count, go_in_lanes()), natural_units_of(base_)},
      runs_(scenarios_, kept_, std::move(stop)) {}

bool EnsembleJob::go_in_lanes() const {
  RunSetup setup = MemberScenario(base_).setup;
  setup.chooses_method |= scenarios_.plan().chooses_method;
  return lane_kind(setup) || lane_kind(setup, lane_options(setup));
}

RunOrigin EnsembleJob::origin(const std::string& command) const {
  RunOrigin origin;
  origin.version = version;
  origin.instruction_set = instruction_set();
  const std::string& name = scenarios_.text().name;
  origin.title =
      std::filesystem::path(name).stem().string() + ": " + std::to_string(scenarios_.plan().count) + " members";
  origin.command = command;
  origin.scenario_name = public_name(name);
  origin.scenario = scenarios_.text().text;
  origin.overrides = scenarios_.overrides();
  origin.model = scenarios_.model();
  return origin;
}

void EnsembleJob::require_members() {
  constexpr std::int64_t most = 64;
  const std::int64_t all = head_.plan.count, count = std::min(most, all);
  std::string first;
  for (std::int64_t k = 0; k < count; ++k) {
    try {
      scenarios_.of_member(k * (all / count));
      return;
    } catch (const InputError& error) {
      if (first.empty()) first = error.what();
    }
  }
  throw InputError(first);
}

std::vector<std::string> EnsembleJob::warnings(const EnsembleTally& tally) const {
  std::vector<std::string> warnings;
  if (tally.untrusted > 0) {
    const std::int64_t first = tally.first_untrusted;
    std::string numbers;
    for (const std::string& each : head_.plan.overrides(first)) numbers += (numbers.empty() ? "" : ", ") + each;
    const auto advice = [](const auto& scenario) { return detail::smaller_step_advice(scenario.options); };
    warnings.push_back("of " + std::to_string(tally.looked_at) + " members that were looked at again " +
                       std::to_string(tally.untrusted) +
                       " cannot be trusted, or not to the last digits (trusted = 0 in the file); the first, member " +
                       std::to_string(first) + ": " + numbers + "; " + std::visit(advice, base_));
  }
  if (tally.failed() > 0) {
    warnings.push_back(std::to_string(tally.failed()) + " of " + std::to_string(head_.plan.count) +
                       " members failed; the first, member " + std::to_string(tally.first_failure.member) + ": " +
                       tally.first_failure.text);
  }
  return warnings;
}

void run_chunks(const EnsembleJob& job, int threads, const std::function<std::optional<std::int64_t>()>& claim,
                const std::function<void(const DoneChunk&)>& take) {
  const auto claim_members = [&]() -> std::optional<Chunk> {
    const std::optional<std::int64_t> k = claim();
    return k ? std::optional(job.head().members_of(*k)) : std::nullopt;
  };
  try {
    for_each_chunk(threads, claim_members, [&](const Chunk& members) { take(job.run(members)); });
  } catch (const Interrupted&) {
    // what is done was taken
  }
}

}  // namespace pendula::io
